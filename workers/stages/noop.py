"""``noop``: hold the worker for a while."""

from __future__ import annotations

import time

from dlo_client.contracts import NoopRequest, NoopResult

from workers.stages.outcome import Outcome


def run(request: NoopRequest) -> Outcome:
    if request.hold_s:
        time.sleep(request.hold_s)
    return Outcome(NoopResult(held_s=request.hold_s))
