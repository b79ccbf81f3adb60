import json
import logging
import subprocess
import sys

from tests.processes import ROOT
from workers.logs import Bounded

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
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, check=True
    )
    lines = [json.loads(line) for line in done.stderr.splitlines()]
    assert [(line["event"], line["level"]) for line in lines] == [
        ("job succeeded", "info"),
        ("job failed", "error"),
        ("could not connect", "error"),
    ]
    assert lines[0]["job_id"] == "42"
    assert lines[1]["incident"] == "abc"
    assert "ZeroDivisionError" in lines[1]["exception"]


class TestBounded:
    """Out of descriptors the service wrote 41 MB of one warning."""

    @staticmethod
    def record(msg, level=logging.WARNING, name="asyncio"):
        return logging.LogRecord(name, level, __file__, 1, msg, (), None)

    def test_of_one_text_few_pass_and_the_next_window_states_how_many_did_not(self):
        now = 0.0
        bounded = Bounded(most=3, window_s=10, clock=lambda: now)
        assert sum(bounded.filter(self.record("out of descriptors")) for _ in range(1000)) == 3
        now = 10.0
        after = self.record({"event": "out of descriptors"})
        assert bounded.filter(after)
        assert after.msg["left_out_before"] == 997
        plain = self.record("accept failed")
        assert bounded.filter(plain)
        assert plain.getMessage() == "accept failed"

    def test_other_texts_and_what_is_no_warning_pass(self):
        bounded = Bounded(most=1, window_s=10, clock=lambda: 0.0)
        assert all(bounded.filter(self.record(f"warning {k}")) for k in range(5))
        assert all(bounded.filter(self.record("request", logging.INFO)) for _ in range(5))

    def test_what_it_remembers_is_bounded(self):
        bounded = Bounded(clock=lambda: 0.0)
        for k in range(3000):
            bounded.filter(self.record(f"warning {k}"))
        assert len(bounded._seen) <= 1001
