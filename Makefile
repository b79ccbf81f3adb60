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
SOAK ?= 0
COUNT ?= 10000
CORES := $(shell nproc 2>/dev/null || echo 2)
# Processes that run tests, each with a queue server of its own: one more than cores, for many tests wait for others.
JOBS ?= $(shell expr 1 + $(CORES))

.PHONY: run serve dev test quick lint audit rehearse docs coverage bench faults load fuzz lock clean

## Start everything, find the cables of IMAGE through HTTP, print them, stop.
run: $(BIN)/.service
	@DLO_LOG_LEVEL=WARNING $(BIN)/python -m services --port 0 --workers 1 --data-dir build/run/data \
		--then $(BIN)/dlo instances $(IMAGE) --out build/run

## Keep the service up: http://HOST:PORT, viewer at /, documentation at /docs.
serve: $(BIN)/.service
	@$(BIN)/python -m services --host $(HOST) --port $(PORT) --workers $(WORKERS) --data-dir $(DATA)

## The tools for tests and training.
dev: $(BIN)/.dev

# Threads within a process would only take the processor from the other processes.
PYTEST := OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest --dist worksteal

## Everything that CI runs. The summary at its end names what was skipped and why, what hung once and was run again, and
## the slowest.
test: lint docs
	$(PYTEST) -n $(JOBS) -rR --durations=8 --reruns 1 --only-rerun "from pytest-timeout" --cov --cov-report=

## The lines that the last `make test` did not reach, to build/coverage/html.
coverage: $(BIN)/.dev
	$(BIN)/coverage html -q -d build/coverage/html

## Lint, types and the unit tests: what to run while working. Of these few wait, and each process imports all tests.
quick: lint
	$(PYTEST) -n $(CORES) -m "not system and not slow"

lint: $(BIN)/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/hadolint Dockerfile

## Scanners: bandit, and known advisories about the locked versions.
audit: $(BIN)/.dev
	.ci/audit $(BIN)/python

## What the images do, in a fresh environment and without Docker; then several hosts, whose cables are pulled.
rehearse: $(BIN)/.dev
	$(BIN)/python -m tests.rehearsal
	$(BIN)/python -m tests.rehearsal.hosts

## The documentation, to build/docs; a warning, such as a link that leads nowhere, is an error.
docs: $(BIN)/.dev
	$(BIN)/python -m sphinx -q -W --keep-going -d build/doctrees docs build/docs

## Measure: tables on the screen, JSON in build/bench, tests/benchmarks/RESULTS.md from both.
bench: $(BIN)/.dev
	$(BIN)/python -m tests.benchmarks --shared $(SHARED)

## Make every fault happen, with real processes, and count what became of the jobs.
faults: $(BIN)/.dev
	$(BIN)/python -m tests.faults

## Jobs at rising rates; SOAK=600 goes on for ten minutes.
load: $(BIN)/.dev
	$(BIN)/python -m tests.load --soak $(SOAK)

## Generated requests and damaged pictures, COUNT of them.
fuzz: $(BIN)/.dev
	$(BIN)/python -m tests.fuzz --count $(COUNT)

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

$(BIN)/.dev: requirements/dev.txt requirements/s3.txt requirements/telemetry.txt requirements/label-tools.txt $(BIN)/.service
	$(BIN)/pip install --quiet --disable-pip-version-check -r requirements/service.txt -r requirements/s3.txt \
		-r requirements/telemetry.txt -r requirements/dev.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps -r requirements/label-tools.txt
	@touch $@
