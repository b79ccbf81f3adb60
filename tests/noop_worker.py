"""``python -m tests.noop_worker``: as ``python -m workers``, with a child that loads no network.

For tests of processes, whose jobs compute nothing. Networks take a child two seconds of a core, and
children are killed and started anew there by the dozen.
"""

from __future__ import annotations

import sys

from workers import __main__ as worker
from workers import child, child_process, stages

CHILD = "tests.noop_worker"
"""The same module with the arguments of :mod:`workers.child`, a socket and the parent's number."""


if __name__ == "__main__":
    if sys.argv[1].isdecimal():
        stages.inference.manifest = dict  # type: ignore[assignment]
        stages.first_use.use = lambda _: []
        child.main(int(sys.argv[1]), int(sys.argv[2]))
    else:
        child_process.PROGRAM = CHILD
        sys.exit(worker.main())
