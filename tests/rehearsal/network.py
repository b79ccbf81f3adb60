"""Hosts on one machine: network namespaces on a bridge, which only this process and its children
see."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

_INSIDE = "DLO_REHEARSAL_INSIDE"
_NET = "10.77.0"
_NAMES = Path("/run/netns")


class NoNamespacesError(Exception):
    """This machine does not let us make hosts; the message is why."""


def go_inside() -> None:
    """Run this program again with a network and mounts of its own; returns in the second run."""
    if os.environ.get(_INSIDE):
        return
    unshare = shutil.which("unshare")
    if os.getuid() or not unshare or not shutil.which("ip"):
        raise NoNamespacesError("hosts need root, unshare and ip (util-linux, iproute2)")
    os.environ[_INSIDE] = "1"
    os.execv(unshare, [unshare, "--net", "--mount", *sys.orig_argv])


class Network:
    """Host ``n`` has the address ``10.77.0.n``; this process is host 254."""

    def __init__(self) -> None:
        _NAMES.mkdir(exist_ok=True)
        try:
            _run("mount", "-t", "tmpfs", "tmpfs", str(_NAMES))
            _run("ip", "link", "set", "lo", "up")
            _run("ip", "link", "add", "plant", "type", "bridge")
            _run("ip", "addr", "add", f"{_NET}.254/24", "dev", "plant")
            _run("ip", "link", "set", "plant", "up")
        except subprocess.CalledProcessError as error:
            raise NoNamespacesError(error.stderr.strip()) from error

    def host(self, number: int) -> Host:
        return Host(number)


class Host:
    """One host and what runs on it."""

    def __init__(self, number: int) -> None:
        self.address = f"{_NET}.{number}"
        self._name, self._cable = f"host{number}", f"cable{number}"
        _run("ip", "netns", "add", self._name)
        _run(
            "ip",
            "link",
            "add",
            self._cable,
            "type",
            "veth",
            "peer",
            "name",
            "eth0",
            "netns",
            self._name,
        )
        _run("ip", "link", "set", self._cable, "master", "plant", "up")
        for change in (
            ["link", "set", "lo", "up"],
            ["addr", "add", f"{self.address}/24", "dev", "eth0"],
            ["link", "set", "eth0", "up"],
        ):
            _run("ip", "-n", self._name, *change)

    def start(
        self, command: list[str], folder: Path, env: dict[str, str]
    ) -> subprocess.Popen[bytes]:
        """Run a program there; its output is in ``folder``."""
        program = [str(shutil.which("ip")), "netns", "exec", self._name, *command]
        with (folder / "log").open("ab") as log:
            return subprocess.Popen(
                program, env=env, stdin=subprocess.DEVNULL, stdout=log, stderr=log
            )

    def unplug(self) -> None:
        _run("ip", "link", "set", self._cable, "down")

    def plug(self) -> None:
        _run("ip", "link", "set", self._cable, "up")


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True)
