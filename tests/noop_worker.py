"""``python -m tests.noop_worker``: as ``python -m workers``, with a child that loads no network.

For tests of processes, whose jobs compute nothing. Networks take a child two seconds of a core, and
the modules of the other kinds of jobs one second, and children are killed and started anew there by
the dozen.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import get_args

from dlo_client.contracts import JobKind

CHILD = "tests.noop_worker"
"""The same module with the arguments of :mod:`workers.child`, a socket and the parent's number."""


def _serve_parent(socket: int, parent: int) -> None:
    """As :mod:`workers.child`; a job of another kind than noop fails."""
    for name in {*get_args(JobKind), "first_use"} - {"noop"}:
        sys.modules[f"workers.stages.{name}"] = ModuleType(name)
    sys.modules["workers.robot_poses"] = poses = ModuleType("robot_poses")
    poses.robot_poses = None  # type: ignore[attr-defined]
    from workers import child, stages

    stages.inference.manifest = dict  # type: ignore[assignment]
    stages.first_use.use = lambda _: []
    child.main(socket, parent)


def _work() -> int:
    """As :mod:`workers.__main__`; its exit status."""
    from workers import __main__ as worker
    from workers import child_process

    child_process.PROGRAM = CHILD
    return worker.main()


if __name__ == "__main__":
    if sys.argv[1].isdecimal():
        _serve_parent(int(sys.argv[1]), int(sys.argv[2]))
    else:
        sys.exit(_work())
