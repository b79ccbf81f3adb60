"""Where this process listens, whoever started it: without keys, only to its own machine."""

from __future__ import annotations

import ipaddress
from pathlib import Path

_LISTENING = "0A"
_ADDRESS, _STATE, _INODE = 1, 3, 9


def exposed() -> list[str]:
    """The addresses, not loopback, that this process listens on; none where the system does not
    say."""
    own = _own_sockets()
    tables = (Path("/proc/self/net/tcp"), Path("/proc/self/net/tcp6"))
    lines = [
        line.split()
        for table in tables
        if table.exists()
        for line in table.read_text().splitlines()[1:]
    ]
    listening = [
        line[_ADDRESS] for line in lines if line[_STATE] == _LISTENING and line[_INODE] in own
    ]
    addresses = [_address(text.partition(":")[0]) for text in listening]
    return [str(address) for address in addresses if not address.is_loopback]


def _own_sockets() -> set[str]:
    """Inodes."""
    inodes = set()
    for descriptor in Path("/proc/self/fd").iterdir() if Path("/proc/self/fd").exists() else ():
        try:
            kind, _, inode = str(descriptor.readlink()).partition(":")
        except OSError:  # closed meanwhile
            continue
        if kind == "socket":
            inodes.add(inode.strip("[]"))
    return inodes


def _address(digits: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address:
    """The kernel writes each group of four bytes as a number of this machine, which is
    little-endian."""
    raw = bytes.fromhex(digits)
    ordered = b"".join(raw[start : start + 4][::-1] for start in range(0, len(raw), 4))
    address = ipaddress.ip_address(ordered)
    return getattr(address, "ipv4_mapped", None) or address
