"""The application as a server of its own starts it."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from tests.processes import ROOT

PROGRAM = """
import logging.config, uvicorn
logging.config.dictConfig(uvicorn.config.LOGGING_CONFIG)
from services.app import create_app
create_app()
logging.getLogger("uvicorn.error").warning("started")
logging.getLogger("services.test").error("incident")
"""


@pytest.mark.slow
def test_logs_are_json_lines_when_uvicorn_starts_it():
    """Only ``python -m services`` configured them: in containers they were colored text."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert [json.loads(line)["event"] for line in done.stderr.splitlines()] == [
        "started",
        "incident",
    ]
