import json
import subprocess
import sys

from tests.processes import ROOT

PROGRAM = """
import logging, structlog
from workers import logs
logs.configure("INFO")
log = structlog.get_logger("workers.test")
log.debug("unheard")
log.info("job succeeded", job_id="42")
try:
    1 / 0
except ZeroDivisionError:
    log.exception("job failed", incident="abc")
logging.getLogger("rq.worker").info("chatter")
logging.getLogger("rq.worker").error("could not %s", "connect")
"""


def test_every_line_is_one_json_object_rqs_too():
    done = subprocess.run([sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, check=True)
    lines = [json.loads(line) for line in done.stderr.splitlines()]
    assert [(line["event"], line["level"]) for line in lines] == [
        ("job succeeded", "info"),
        ("job failed", "error"),
        ("could not connect", "error"),
    ]
    assert lines[0]["job_id"] == "42"
    assert lines[1]["incident"] == "abc"
    assert "ZeroDivisionError" in lines[1]["exception"]
