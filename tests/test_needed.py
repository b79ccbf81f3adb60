"""A browser test that is skipped: counted on a developer's machine, a failure in continuous
integration."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parent.parent
SKIPPED = """
import pytest

@pytest.mark.browser
@pytest.mark.skip(reason="no browser here")
def test_page(): ...

@pytest.mark.browser
def test_later():
    pytest.skip("no browser after all")

@pytest.mark.skip(reason="another machine")
def test_other(): ...
"""


def run(folder: Path, needed: str) -> subprocess.CompletedProcess[str]:
    program = folder / "test_skipped.py"
    program.write_text(SKIPPED)
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-rs",
        "-p",
        "tests.needed",
        "-p",
        "no:cacheprovider",
    ]
    (folder / "pytest.ini").write_text("[pytest]\nmarkers = browser\n")
    return subprocess.run(
        [*command, str(program)],
        cwd=folder,
        env=os.environ
        | {
            "PYTHONPATH": str(ROOT),
            "DLO_TESTS_NEED": needed,
            "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        },
        capture_output=True,
        text=True,
        check=False,
    )


def test_elsewhere_they_are_counted_with_the_reason(tmp_path):
    done = run(tmp_path, "")
    assert done.returncode == 0, done.stdout
    assert "3 skipped" in done.stdout
    assert "no browser here" in done.stdout


def test_where_a_browser_is_needed_the_run_fails(tmp_path):
    """A run without Chromium was green: all browser tests were skipped."""
    done = run(tmp_path, "browser")
    assert done.returncode == 1, done.stdout
    assert "1 failed, 1 skipped, 1 error" in done.stdout  # in the test, and before it
    assert "DLO_TESTS_NEED=browser: Skipped: no browser here" in done.stdout
