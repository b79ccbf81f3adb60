"""What the container files promise, checked without a container engine."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import yaml

ROOT = Path(__file__).parent.parent


def test_every_path_that_the_image_copies_exists_and_is_let_through():
    copied = re.findall(r"^COPY (\S+) ", (ROOT / "Dockerfile").read_text(), re.M)
    let_through = (ROOT / ".dockerignore").read_text().split()
    assert {"requirements", "clients", "models", "workers", "services"} == set(copied)
    for path in copied:
        assert (ROOT / path).exists()
        assert f"!{path.split('/')[0]}" in let_through
    assert {"models/training", "models/synthesis"} <= set(let_through), "what trains stays out"


def test_compose_builds_targets_that_the_dockerfile_has():
    targets = set(re.findall(r" AS (\w+)$", (ROOT / "Dockerfile").read_text(), re.M))
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    assert {s["build"]["target"] for s in services.values() if "build" in s} <= targets
    assert "noeviction" in str(services["redis"]["command"])
    assert services["service"]["volumes"] == services["worker"]["volumes"], "they share the blobs"


def test_service_and_workers_run_where_torch_is_not_installed():
    """The images install requirements/service.txt alone and hold neither training nor synthesis."""
    program = (
        "import sys\n"
        "absent = ('torch', 'onnx', 'onnxscript', 'tomli_w', 'models.training', 'models.synthesis')\n"
        "sys.modules.update(dict.fromkeys(absent))\n"
        "import services.__main__, workers.__main__, workers.child\n"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_requirement_is_pinned():
    for name in ("service", "s3", "telemetry", "training", "dev"):
        lines = (ROOT / "requirements" / f"{name}.txt").read_text().splitlines()
        assert all("==" in line for line in lines if not line.startswith("#"))


def test_training_workers_run_with_the_versions_that_are_tested():
    pinned = {
        name: set((ROOT / "requirements" / f"{name}.txt").read_text().splitlines()) for name in ("dev", "training")
    }
    assert {line for line in pinned["training"] if not line.startswith("#")} <= pinned["dev"]
