"""``python -m tests.rehearsal.elsewhere``: a worker whose pictures are computed by another machine,
so to say.

Hosts that share the cores of one machine cannot show what a second host adds. Here a job of
``instances`` is all that a service adds to it, its picture fetched from the bucket included, and
instead of the computing a wait of ``DLO_REHEARSAL_WAIT_S`` seconds; its result is that of the
picture which a worker warms up with.
"""

from __future__ import annotations

import os
import sys
import time

from dlo_client.contracts import Contract, InstancesRequest

from workers import __main__ as worker
from workers import child, child_process
from workers.stages import instances
from workers.stages.outcome import Outcome, Tools

WAIT_S = "DLO_REHEARSAL_WAIT_S"


def wait_instead(wait_s: float) -> None:
    """From the second picture on."""
    compute = instances.run
    first: list[Contract] = []

    def run(request: InstancesRequest, tools: Tools) -> Outcome:
        if not first:
            first.append(compute(request, tools).result)
        else:
            tools.blobs.get(request.image.id)
            time.sleep(wait_s)
        return Outcome(first[0])

    instances.run = run


if __name__ == "__main__":
    if sys.argv[1].isdecimal():
        wait_instead(float(os.environ[WAIT_S]))
        child.main(int(sys.argv[1]), int(sys.argv[2]))
    else:
        child_process.PROGRAM = "tests.rehearsal.elsewhere"
        sys.exit(worker.main())
