"""What is in the images, as far as the Dockerfile says."""

from __future__ import annotations

import pytest

from tests.processes import ROOT
from tests.rehearsal.dockerfile import copy_into, ignored, images


@pytest.fixture(scope="module")
def found():
    return images((ROOT / "Dockerfile").read_text())


def test_neither_image_holds_training_or_tests(found, tmp_path):
    for name in ("service", "worker"):
        copy_into(ROOT, found[name], tmp_path / name)
        files = [
            path.relative_to(tmp_path / name).as_posix() for path in (tmp_path / name).rglob("*.*")
        ]
        assert files
        assert not [
            file
            for file in files
            if file.startswith(("models/training", "models/synthesis", "tests"))
        ]


def test_the_service_has_no_networks_and_the_worker_no_pages(found, tmp_path):
    for name in ("service", "worker"):
        copy_into(ROOT, found[name], tmp_path / name)
    assert not (tmp_path / "service" / "models").exists()
    assert not (tmp_path / "worker" / "services").exists()
    assert list((tmp_path / "worker" / "models").rglob("*.onnx"))
    assert (tmp_path / "service" / "services" / "pages" / "index.html").exists()


def test_both_run_without_rights_and_by_their_own_entry_points(found):
    assert {found[name].user for name in ("service", "worker")} == {"10001"}
    assert found["worker"].command == ["python", "-m", "workers"]
    assert "services.app:create_app" in found["service"].command


def test_modules_are_compiled_before_the_root_is_read_only(found):
    """Every child of a worker, and every start of the service, compiled three hundred modules
    again."""
    for name in ("service", "worker"):
        assert found[name].runs[-1] == "python -m compileall -q ."
        assert found[name].environment["PYTHONDONTWRITEBYTECODE"] == "1", "nobody writes them later"


@pytest.mark.parametrize(
    ("path", "left_out"),
    [
        ("models/weights/a.onnx", False),
        ("models/training/x.py", True),
        ("tests/conftest.py", True),
        ("services/__pycache__/app.pyc", True),
        ("README.md", True),
        ("workers/jobs.py", False),
    ],
)
def test_what_the_build_passes_over(path, left_out):
    patterns = [line for line in (ROOT / ".dockerignore").read_text().splitlines() if line]
    assert ignored(patterns, path) is left_out
