"""Signs of life to whoever supervises the process, by systemd's protocol (``sd_notify``,
``WATCHDOG=1``)."""

from __future__ import annotations

import contextlib
import os
import socket

VARIABLE = "NOTIFY_SOCKET"
BEAT = b"WATCHDOG=1"


def beat() -> None:
    """Say that we are alive; nothing happens if nobody asked for it or listens."""
    address = os.environ.get(VARIABLE)
    if not address:
        return
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sender:
        sender.setblocking(False)
        sender.sendto(BEAT, f"\0{address[1:]}" if address.startswith("@") else address)
