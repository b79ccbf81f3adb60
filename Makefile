# Two commands for a bare machine with Python 3.11: `make run` and `make test`.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
IMAGE ?= tests/samples/plain.jpg
HOST ?= 127.0.0.1
PORT ?= 8000
WORKERS ?= 1
DATA ?= data
SHARED ?= ../shared

.PHONY: run serve dev test lint bench lock clean

## Start everything, find the cables of IMAGE through HTTP, print them, stop.
run: $(BIN)/.service
	@DLO_LOG_LEVEL=WARNING $(BIN)/python -m services --port 0 --workers 1 --data-dir build/run/data \
		--then $(BIN)/dlo instances $(IMAGE) --out build/run

## Keep the service up: http://HOST:PORT, viewer at /, documentation at /docs.
serve: $(BIN)/.service
	@$(BIN)/python -m services --host $(HOST) --port $(PORT) --workers $(WORKERS) --data-dir $(DATA)

## The tools for tests and training.
dev: $(BIN)/.dev

## Everything that CI runs.
test: lint
	$(BIN)/python -m pytest

lint: $(BIN)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/hadolint Dockerfile

## Measure: tables on the screen, JSON in build/bench, tests/benchmarks/RESULTS.md from both.
bench: $(BIN)/.dev
	$(BIN)/python -m tests.benchmarks --shared $(SHARED)

## Pin again what the .in files allow, in empty environments.
lock:
	./requirements/lock.sh $(PYTHON)

clean:
	rm -rf build data .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

$(BIN)/python:
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) is not on the PATH; name another: make PYTHON=…"; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(BIN)/.service: requirements/service.txt clients/python/pyproject.toml | $(BIN)/python
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements/service.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --editable clients/python
	@touch $@

$(BIN)/.dev: requirements/dev.txt $(BIN)/.service
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements/service.txt -r requirements/dev.txt
	@touch $@
