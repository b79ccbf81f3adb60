"""``python -m workers [--name NAME] [--with-parent PID]``: one warm worker, until SIGTERM."""

from __future__ import annotations

import argparse
import os
import signal
import socket
import sys

from workers import logs, shared_blobs
from workers.blobs import open_blobs
from workers.connection import connect
from workers.lifeline import die_with_parent
from workers.settings import Settings
from workers.warm import WarmWorker


def main() -> int:
    """0 after SIGTERM, 1 when the worker ended by itself and should be started again."""
    parser = argparse.ArgumentParser(prog="python -m workers", description=__doc__)
    parser.add_argument("--name", default=socket.gethostname())
    parser.add_argument("--with-parent", type=int, metavar="PID", help="stop when it ends (on Linux)")
    arguments = parser.parse_args()
    if arguments.with_parent:
        die_with_parent(signal.SIGTERM, arguments.with_parent)
    os.umask(0o077)  # pictures and results are nobody else's
    settings = Settings()
    logs.configure(settings.log_level)
    with connect(settings, patient=True) as client:
        shared_blobs.join(client, settings.keys, open_blobs(settings), arguments.name)
    return 0 if WarmWorker(settings, arguments.name).serve() else 1


if __name__ == "__main__":
    sys.exit(main())
