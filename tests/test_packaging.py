"""What the container files promise, checked without a container engine."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from models.weights.providers import CPU, CUDA
from workers.settings import Settings

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


@pytest.mark.slow
def test_service_and_workers_run_where_torch_is_not_installed():
    """The images install requirements/service.txt alone and hold neither training nor synthesis."""
    program = (
        "import sys\n"
        "absent = ('torch', 'onnx', 'onnxscript', 'tomli_w', 'models.training', 'models.synthesis')\n"
        "sys.modules.update(dict.fromkeys(absent))\n"
        "import services.__main__, services.app\n"
        "assert not {'scipy', 'cv2', 'onnxruntime'} & set(sys.modules), 'it starts slower for nothing'\n"
        "import workers.__main__, workers.child\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_every_requirement_is_pinned():
    for name in ("service", "s3", "telemetry", "training", "cuda", "dev"):
        lines = (ROOT / "requirements" / f"{name}.txt").read_text().splitlines()
        assert all("==" in line for line in lines if not line.startswith("#"))


def pinned(name: str) -> set[tuple[str, str]]:
    """Packages, by the name that the index compares, with their versions."""
    lines = (ROOT / "requirements" / f"{name}.txt").read_text().splitlines()
    parts = (line.split("==") for line in lines if not line.startswith("#"))
    return {(re.sub(r"[-_.]+", "-", package).lower(), version) for package, version in parts}


def test_training_workers_run_with_the_versions_that_are_tested():
    assert pinned("training") <= pinned("dev")


def test_a_worker_with_a_gpu_has_another_onnx_runtime_and_nothing_else_is_different():
    """A list of one package went stale: what was to be installed beside it was said in a
    comment."""
    service, cuda = pinned("service"), pinned("cuda")
    assert {name for name, _ in service - cuda} == {"onnxruntime"}
    more = {name for name, _ in cuda - service}
    assert {name for name in more if not name.startswith("nvidia-")} == {"onnxruntime-gpu"}
    assert {"nvidia-cuda-runtime", "nvidia-cudnn-cu13"} <= more, "the image has no CUDA of its own"


def test_the_image_of_a_worker_with_a_gpu_is_built_from_its_list():
    worker = yaml.safe_load((ROOT / "deploy" / "gpu.yaml").read_text())["services"]["worker"]
    (lock,) = worker["build"]["args"].values()
    dockerfile = (ROOT / "Dockerfile").read_text()
    assert "ARG LOCK=service\n" in dockerfile
    assert "requirements/${LOCK}.txt" in dockerfile
    assert (ROOT / "requirements" / f"{lock}.txt").exists()
    wanted = Settings(
        onnx_providers=json.loads(worker["environment"]["DLO_ONNX_PROVIDERS"])
    ).onnx_providers
    assert wanted == [CUDA, CPU], "a host without a GPU computes on its processor"
