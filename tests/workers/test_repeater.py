import threading

import pytest
import redis

from workers.repeater import Repeater


@pytest.mark.parametrize(
    "error", [redis.ConnectionError("away"), OSError("disk"), ValueError("bug")]
)
def test_it_goes_on_whatever_happens_until_stopped(error):
    calls, enough = [], threading.Event()

    def action():
        calls.append(1)
        if len(calls) == 3:
            enough.set()
        raise error

    repeater = Repeater("test", 0.001, action)
    repeater.start()
    assert enough.wait(10)
    repeater.stop()
    assert "test" not in [thread.name for thread in threading.enumerate()]
