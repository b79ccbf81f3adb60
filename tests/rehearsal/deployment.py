"""``deploy/three-hosts.yaml`` on hosts that are network namespaces, each with a folder of its own.

A queue behind TLS, an S3 server, two replicas of the service behind a plain proxy, and hosts with a
worker each.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import trustme

from services import keys
from tests.processes import ROOT, wait_until
from tests.rehearsal.compose import environment
from tests.rehearsal.dockerfile import images
from tests.rehearsal.network import Host, Network
from workers.embedded import PASSWORD

QUEUE, S3, PROXY, SERVICES, WORKERS, STRANGER = 1, 5, 9, (2, 3), (11, 12), 13
"""Numbers of hosts."""

_FILE = ROOT / "deploy" / "three-hosts.yaml"
_READY_WITHIN_S = 240.0


class Hosts:
    """All of them, in ``folder``; programs on one host are told apart by the sign of its number."""

    queue, bucket, proxy, services, workers, stranger = (
        QUEUE,
        S3,
        PROXY,
        SERVICES,
        WORKERS,
        STRANGER,
    )

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._network = Network()
        self._started: dict[int, subprocess.Popen[bytes]] = {}
        numbers = (QUEUE, S3, PROXY, *SERVICES, *WORKERS, STRANGER)
        self.hosts: dict[int, Host] = {number: self._network.host(number) for number in numbers}
        self._key = keys.add(folder / "keys.toml", "rehearsal", ("admin",))
        (folder / "queue.password").write_text("of-the-rehearsal")
        authority = trustme.CA()
        authority.cert_pem.write_to_path(folder / "ca.pem")
        authority.issue_cert(
            self.hosts[QUEUE].address
        ).private_key_and_cert_chain_pem.write_to_path(folder / "queue.pem")
        self._values = {
            "QUEUE_HOST": self.hosts[QUEUE].address,
            "DLO_BLOBS_URL": "s3://dlo/cell-3",
            "DLO_WORKERS": "1",
            "AWS_ENDPOINT_URL_S3": f"http://{self.hosts[S3].address}:9000",
            "AWS_DEFAULT_REGION": "us-east-1",
            "AWS_ACCESS_KEY_ID": "plant",
            "AWS_SECRET_ACCESS_KEY": "of-the-plant",
        }
        self.client = httpx.Client(
            base_url=f"http://{self.hosts[PROXY].address}:80",
            timeout=90,
            headers=self.authorization,
        )

    @property
    def authorization(self) -> dict[str, str]:
        return {
            "Authorization": f"Bearer {self._key}",
            "Connection": "close",
        }  # each request its own replica

    def begin(self) -> None:
        """Start everything; return once both replicas are ready."""
        queue, inner = self.hosts[QUEUE].address, "127.0.0.1:6380"
        embedded = [sys.executable, "-m", "workers.embedded", "--port", "6380", "--dir"]
        password = {PASSWORD: "of-the-rehearsal"}
        self._start(QUEUE, [*embedded, str(self._folder_of(QUEUE))], password)
        relay = [sys.executable, "-m", "tests.rehearsal.relay", "--with-parent", str(os.getpid())]
        front = [*relay, "--listen"]
        certificate = ["--certificate", str(self._folder / "queue.pem")]
        self._start(-QUEUE, [*front, f"{queue}:6379", "--to", inner, *certificate])
        bucket = self._folder_of(S3) / "objects" / "dlo"
        bucket.mkdir(parents=True)
        rclone = str(Path(sys.executable).with_name("rclone"))
        auth = f"{self._values['AWS_ACCESS_KEY_ID']},{self._values['AWS_SECRET_ACCESS_KEY']}"
        where = f"{self.hosts[S3].address}:9000"
        self._start(
            S3, [rclone, "serve", "s3", str(bucket.parent), "--addr", where, "--auth-key", auth]
        )
        for number in SERVICES:
            self._start(
                number,
                _program("service"),
                environment(_FILE, "service", self._values, self._folder),
            )
        addresses = ",".join(f"{self.hosts[number].address}:8000" for number in SERVICES)
        self._start(PROXY, [*front, f"{self.hosts[PROXY].address}:80", "--to", addresses])
        self.at_work(len(WORKERS))

    def at_work(self, count: int, module: str = "workers", **changes: str) -> None:
        """Let so many hosts have a worker; return once they are ready. Those that have one keep
        it."""
        for number in WORKERS[count:]:
            if number in self._started:
                self.stop(number)
        for number in WORKERS[:count]:
            if number not in self._started:
                warm = self.log_of(number).count("child warm")
                self.work(number, module, **changes)
                wait_until(
                    lambda number=number, warm=warm: self.log_of(number).count("child warm") > warm,
                    _READY_WITHIN_S,
                )
        if count:
            wait_until(self.ready, _READY_WITHIN_S)

    def work(self, number: int, module: str = "workers", **changes: str) -> None:
        """Start the worker of a host."""
        env = environment(_FILE, "worker", self._values | changes, self._folder)
        program = [module if part == "workers" else part for part in _program("worker")]
        command = [*program, "--name", f"host{number}", "--with-parent", str(os.getpid())]
        self._start(number, command, env | {"DLO_SPARE_CHILD": "false"} | changes)

    def stop(self, number: int) -> None:
        process = self._started.pop(number)
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(30)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def end(self) -> None:
        self.client.close()
        for process in self._started.values():
            process.kill()
            process.wait()

    def log_of(self, number: int) -> str:
        log = self._folder_of(number) / "log"
        return log.read_text() if log.exists() else ""

    def ready(self) -> bool:
        """Whether each replica says so."""
        return all(self._answers(number) for number in SERVICES)

    def _answers(self, number: int) -> bool:
        try:
            return (
                httpx.get(f"http://{self.hosts[number].address}:8000/readyz", timeout=5).status_code
                == 200
            )
        except httpx.HTTPError:
            return False

    def _folder_of(self, number: int) -> Path:
        folder = self._folder / f"host{number}"
        folder.mkdir(exist_ok=True)
        return folder

    def _start(self, number: int, command: list[str], env: dict[str, str] | None = None) -> None:
        folder = self._folder_of(number)
        plain = {
            "PATH": os.environ["PATH"],
            "HOME": str(folder),
            "PYTHONPATH": f"{ROOT}:{ROOT / 'clients/python'}",
        }
        plain |= {"DLO_DATA_DIR": str(folder), "DLO_LOG_LEVEL": "INFO", "OMP_NUM_THREADS": "1"}
        self._started[number] = self.hosts[abs(number)].start(command, folder, plain | (env or {}))


def _program(name: str) -> list[str]:
    """The entry point of an image, here."""
    command = images((ROOT / "Dockerfile").read_text())[name].command
    return [sys.executable, *(["-m", "uvicorn"] if command[0] == "uvicorn" else []), *command[1:]]
