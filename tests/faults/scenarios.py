"""The faults, one function each: makes it happen on a plant of its own and counts what became of the jobs."""

from __future__ import annotations

import contextlib
import io
import random
import signal
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
from PIL import Image

from tests.faults.plant import KINDS, Plant, plant
from tests.faults.traffic import Tally, Traffic, all_jobs, probe
from tests.processes import ROOT, wait_until

_SHIFT = "import time\n_now = time.time\ntime.time = lambda: _now() + {seconds}\n"
_UNREADABLE = """
from pathlib import Path
_read = Path.read_bytes
def read_bytes(self):
    if self.suffix == ".onnx" and not Path({allowed!r}).exists():
        raise PermissionError(f"{{self}} cannot be read")
    return _read(self)
Path.read_bytes = read_bytes
"""


def kills(jobs: int, faults: int) -> Tally:
    """SIGKILL of child, worker, service and queue server in turn, at random moments, while jobs come in."""
    chance = random.Random(1)
    with plant(workers=2, spare_child=True) as there:
        before = sum(there.memory_mb().values())
        traffic = Traffic(there, jobs, pace_s=max(0.02, 2.0 * faults / jobs)).start()
        recovered = []
        for k in range(faults):
            time.sleep(chance.uniform(0.2, 1.0))
            there.kill(KINDS[k % len(KINDS)], chance)
            recovered.append(probe(there))
        found = traffic.tally()
        found.faults, found.worst_recovery_s = faults, round(max(recovered), 2)
        found.grown_mb = round(sum(there.memory_mb().values()) - before, 1)
    return found


def power_loss(jobs: int, faults: int) -> Tally:
    """The queue server is killed and what it wrote in its last second is cut off, as unsynced pages are."""
    with plant() as there:
        traffic = Traffic(there, jobs, pace_s=0.02).start()
        sizes: list[tuple[float, int]] = []
        while traffic.sending:
            sizes.append((time.monotonic(), _log_of(there).stat().st_size))
            time.sleep(0.1)
        known = {job_id: there.queue.get(job_id).created_at for job_id in traffic._ids}
        died = max(known.values())
        there.queue_server.kill()
        cut = next((size for when, size in reversed(sizes) if sizes[-1][0] - when > 1.1), 0)
        with _log_of(there).open("r+b") as file:
            file.truncate(max(cut - 7, 0))  # in the middle of an entry
        there.queue_server.start()
        recovery_s = probe(there)
        remembered = {job.id for job in all_jobs(there)}
        gone = [job_id for job_id in known if job_id not in remembered]
        early = sum((died - known[job_id]).total_seconds() > 2.5 for job_id in gone)
        note = f"{len(gone)} of the last second's jobs forgotten (appendfsync everysec), {early} older"
        return Tally(lost=early, jobs=jobs, faults=1, worst_recovery_s=round(recovery_s, 2), note=note)


def _log_of(there: Plant) -> Path:
    return max((there.folder / "queue" / "appendonlydir").glob("*.incr.aof"), key=lambda file: file.name)


def full_disk(jobs: int, faults: int) -> Tally:
    """A small disk is filled to its last byte and freed again: refused meanwhile, nothing half-written."""
    with _small_disk() as disk, Plant(disk) as there:
        with httpx.Client(base_url=there.url, timeout=20) as client:
            first = client.post("/v1/images", content=_picture(0)).status_code
            filler = disk / "filler"
            with contextlib.suppress(OSError), filler.open("wb", buffering=0) as file:
                while True:
                    file.write(bytes(65536))
            answers = [client.post("/v1/images", content=_picture(1 + k)).status_code for k in range(jobs)]
            filler.unlink()
            started = time.monotonic()
            wait_until(lambda: client.post("/v1/images", content=_picture(-1)).status_code == 201, 60)
            recovery_s = max(time.monotonic() - started, probe(there))
        half = [file for file in (disk / "data" / "blobs").glob("??/*") if len(file.name) != 64]
        refused = sum(status == 507 for status in answers)
        note = f"first {first}, {refused} of {jobs} answered 507, {len(half)} half-written"
        wrong = (first != 201) + (jobs - refused) + len(half)
        return Tally(jobs=jobs, faults=1, wrong=wrong, worst_recovery_s=round(recovery_s, 2), note=note)


@contextmanager
def _small_disk() -> Iterator[Path]:
    """16 MiB; needs the right to mount."""
    folder = Path(tempfile.mkdtemp(prefix="plant-disk-"))
    command = ["mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SkippedError(f"cannot mount a small disk: {done.stderr.strip()}")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=False)
        folder.rmdir()


def _picture(number: int) -> bytes:
    """270 kB of noise, each number another."""
    buffer = io.BytesIO()
    Image.frombytes("RGB", (300, 300), random.Random(number).randbytes(270_000)).save(buffer, "BMP")
    return buffer.getvalue()


class SkippedError(Exception):
    """The machine does not allow a scenario; the message names what is missing."""


def frozen_queue(jobs: int, faults: int) -> Tally:
    """The queue server stands still for three seconds, as on a slow disk, again and again."""
    with plant() as there:
        traffic = Traffic(there, jobs, pace_s=0.05).start()
        recovered = []
        for _ in range(faults):
            process = there.queue_server._process
            assert process is not None
            process.send_signal(signal.SIGSTOP)
            time.sleep(3.0)
            process.send_signal(signal.SIGCONT)
            recovered.append(probe(there))
        found = traffic.tally()
        found.faults = faults
        found.worst_recovery_s = round(max(recovered), 2)
        return found


def full_queue(jobs: int, faults: int) -> Tally:
    """Many more jobs than may wait: refused with 429 and a time to come back; all are done in the end."""
    with plant(max_queue_depth=5) as there:
        senders = [Traffic(there, max(1, jobs // 4), pace_s=0.0).start() for _ in range(4)]
        started = time.monotonic()
        parts = [sender.tally() for sender in senders]
        return Tally(
            jobs=sum(part.jobs for part in parts), lost=sum(part.lost for part in parts), faults=1,
            wrong=sum(part.wrong for part in parts), failed=sum(part.failed for part in parts),
            doubled=sum(part.doubled for part in parts),
            worst_recovery_s=round(time.monotonic() - started, 2), note="seconds are those of the whole flood",
        )  # fmt: skip


def clock_jump(jobs: int, faults: int) -> Tally:
    """Workers and service whose clocks are a day and a half ahead: jobs and pictures live by the server's."""
    with _overlay(_SHIFT.format(seconds=130_000)) as env, plant(env=env) as there:
        with httpx.Client(base_url=there.url, timeout=20) as client:
            image = client.post("/v1/images", content=_picture(0)).json()["id"]
            found = Traffic(there, jobs, pace_s=0.02).start().tally()
            kept = client.post("/v1/jobs", json={"kind": "segment", "image": {"id": image}}).status_code == 202
        found.faults, found.wrong = 1, found.wrong + (not kept)
        found.note = "the picture is still there" if kept else "the picture was swept"
        return found


def unreadable_weights(jobs: int, faults: int) -> Tally:
    """A worker that cannot read its networks is never ready and does not take jobs; once it can, it does them."""
    with tempfile.TemporaryDirectory() as folder:
        allowed = Path(folder) / "allowed"
        with _overlay(_UNREADABLE.format(allowed=str(allowed))) as env:
            there = Plant(Path(folder) / "plant", env=env)
            try:
                traffic = Traffic(there, jobs, pace_s=0.0).start()
                give_up = time.monotonic() + 15
                while time.monotonic() < give_up:
                    assert not there.ready()
                    time.sleep(0.5)
                allowed.touch()
                started = time.monotonic()
                wait_until(there.ready, 120)
                found = traffic.tally()
                found.faults, found.worst_recovery_s = 1, round(time.monotonic() - started, 2)
                found.note = "seconds include the loading of the networks"
                return found
            finally:
                there.__exit__()


@contextmanager
def _overlay(program: str) -> Iterator[dict[str, str]]:
    """The environment of processes that run ``program`` when they start."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "sitecustomize.py").write_text(program)
        yield {"PYTHONPATH": f"{folder}:{ROOT}:{ROOT / 'clients/python'}"}


def client_gone(jobs: int, faults: int) -> Tally:
    """Clients that hang up while they wait: their jobs end, and no connection stays open."""
    with plant() as there:
        host, port = there.url.removeprefix("http://").split(":")
        body = b'{"kind":"noop","hold_s":0.2,"timeout_s":600}'
        head = f"POST /v1/jobs?wait=30 HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n"
        for _ in range(jobs):
            with socket.create_connection((host, int(port))) as connection:
                before = there.queue.counts().get(("noop", "queued"), 0)
                connection.sendall(head.encode() + b"Content-Length: %d\r\n\r\n" % len(body) + body)
                wait_until(lambda before=before: there.queue.counts().get(("noop", "queued"), 0) > before, 60)
        recovery_s = probe(there)

        def ended() -> bool:
            counts = there.queue.counts()
            over = sum(counts.get(("noop", state), 0) for state in ("succeeded", "failed"))
            return over >= counts["noop", "queued"] >= jobs

        wait_until(ended, 300)
        failed = there.queue.counts().get(("noop", "failed"), 0)
        return Tally(jobs=jobs, faults=jobs, failed=failed, worst_recovery_s=round(recovery_s, 2))


def hanging_jobs(jobs: int, faults: int) -> Tally:
    """Jobs that never end are stopped at their time limit, and hold up the next one by no more than that."""
    with plant() as there, httpx.Client(base_url=there.url, timeout=20) as client:
        recovered = []
        for _ in range(faults):
            asked = {"kind": "noop", "hold_s": 60, "timeout_s": 1.0}
            hung = client.post("/v1/jobs?wait=15", json=asked).json()
            assert hung["problem"]["code"] in ("timed_out", "deadline_exceeded"), hung
            recovered.append(probe(there))
        found = Traffic(there, jobs, pace_s=0.02).start().tally()
        found.faults, found.worst_recovery_s = faults, round(max(recovered), 2)
        return found


def dripping_clients(jobs: int, faults: int) -> Tally:
    """Fifty clients that send a byte a second: everybody else is served as before."""
    with plant() as there:
        host, port = there.url.removeprefix("http://").split(":")
        stop = threading.Event()
        head = f"POST /v1/jobs HTTP/1.1\r\nHost: {host}\r\nContent-Length: 100000\r\n\r\n".encode()

        def drip() -> None:
            with contextlib.suppress(OSError), socket.create_connection((host, int(port))) as connection:
                connection.sendall(head)
                while not stop.wait(1.0):
                    connection.sendall(b" ")

        threads = [threading.Thread(target=drip, daemon=True) for _ in range(50)]
        for thread in threads:
            thread.start()
        recovery_s = probe(there)
        found = Traffic(there, jobs, pace_s=0.02).start().tally()
        stop.set()
        found.faults, found.worst_recovery_s = 50, round(recovery_s, 2)
        return found


SCENARIOS: dict[str, Callable[[int, int], Tally]] = {
    scenario.__name__: scenario
    for scenario in (
        kills, power_loss, full_disk, frozen_queue, full_queue, clock_jump, unreadable_weights, client_gone,
        hanging_jobs, dripping_clients,
    )
}  # fmt: skip
