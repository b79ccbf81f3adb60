"""What runs in the warm child: load the networks once, then one job after another as the parent
states.

Started by :mod:`workers.child_process`, with a socket to the parent: settings come in, the list of
networks goes out, then for each job a claim in, at its end the memory in use out.
"""

from __future__ import annotations

import gc
import json
import os
import signal
import sys
from multiprocessing.connection import Connection
from pathlib import Path

from workers import jobs, logs, memory, stages, tracing
from workers.connection import connect
from workers.ledger import Claim, Ledger
from workers.lifeline import die_with_parent
from workers.settings import Settings

_PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 2**20


def main(socket: int, parent: int) -> None:
    """Serve the parent until it closes the socket or dies."""
    die_with_parent(signal.SIGKILL, parent)
    with Connection(socket) as connection:
        settings = Settings.model_validate_json(connection.recv_bytes())
        logs.configure(settings.log_level)
        tracing.begin()
        tools = stages.warm(settings)
        ledger = Ledger(connect(settings, patient=True), settings)
        connection.send_bytes(
            json.dumps([network.model_dump() for network in tools.networks]).encode()
        )
        gc.collect()
        gc.freeze()  # networks and modules are no garbage: looking through them held jobs up
        memory.limit(settings)
        while message := _receive(connection):
            jobs.run(Claim(**json.loads(message)), ledger, tools)
            connection.send_bytes(json.dumps({"rss_mb": _rss_mb()}).encode())


def _receive(connection: Connection) -> bytes | None:
    try:
        return connection.recv_bytes()
    except (EOFError, ConnectionResetError):  # the parent was killed
        return None


def _rss_mb() -> float:
    """Memory in use now; 0 where the system does not say."""
    statistics = Path("/proc/self/statm")
    return int(statistics.read_text().split()[1]) * _PAGE_MB if statistics.exists() else 0.0


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
