"""``python -m workers [--name NAME] [--queues A,B] [--with-parent PID]``: one warm worker, until
SIGTERM.

``--queues training`` takes the jobs that adapt networks; it needs the packages of
``requirements/training.txt``.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import signal
import socket
import sys

from workers import logs, shared_blobs
from workers.blobs import open_blobs
from workers.connection import connect
from workers.lifeline import die_with_parent
from workers.record import ALL_QUEUES, QUEUES, TRAINING
from workers.settings import Settings
from workers.warm import WarmWorker

_TRAINING_PACKAGES = ("torch", "onnx")


def main() -> int:
    """0 after SIGTERM, 1 when the worker ended by itself and should be started again."""
    parser = argparse.ArgumentParser(prog="python -m workers", description=__doc__)
    parser.add_argument("--name", default=socket.gethostname())
    parser.add_argument(
        "--with-parent", type=int, metavar="PID", help="stop when it ends (on Linux)"
    )
    parser.add_argument(
        "--queues", type=_queues, default=QUEUES, help=f"some of {', '.join(ALL_QUEUES)}; in order"
    )
    arguments = parser.parse_args()
    if TRAINING in arguments.queues and (missing := _missing()):
        parser.error(
            f"{missing} is not installed; training needs: pip install -r requirements/training.txt"
        )
    if arguments.with_parent:
        die_with_parent(signal.SIGTERM, arguments.with_parent)
    os.umask(0o077)  # pictures and results are nobody else's
    settings = Settings()
    logs.configure(settings.log_level)
    with connect(settings, patient=True) as client:
        shared_blobs.join(client, settings.keys, open_blobs(settings), arguments.name)
    return 0 if WarmWorker(settings, arguments.name, arguments.queues).serve() else 1


def _queues(text: str) -> tuple[str, ...]:
    names = tuple(part.strip() for part in text.split(",") if part.strip())
    if not names or not set(names) <= set(ALL_QUEUES):
        raise argparse.ArgumentTypeError(
            f"{text!r} names another queue than {', '.join(ALL_QUEUES)}"
        )
    return names


def _missing() -> str | None:
    """A package that training needs and that is not there."""
    return next(
        (name for name in _TRAINING_PACKAGES if importlib.util.find_spec(name) is None), None
    )


if __name__ == "__main__":
    sys.exit(main())
