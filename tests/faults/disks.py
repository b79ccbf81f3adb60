"""Faults of the disk: cut off, full, slow."""

from __future__ import annotations

import contextlib
import hashlib
import io
import random
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import httpx
from PIL import Image

from tests.faults.overlay import SkippedError, overlay
from tests.faults.plant import Plant, plant
from tests.faults.traffic import Tally, Traffic, all_jobs, probe
from tests.processes import wait_until
from workers.blobs import BlobMissing, FolderBlobs

_MAY_BE_FORGOTTEN_S = 2.5
"""``appendfsync everysec`` loses what the queue server took in its last second, on a busy disk in
the last two."""

_SLOW = """
import os, time
_sync = os.fsync
def fsync(handle):
    time.sleep(1.0)
    _sync(handle)
os.fsync = fsync
"""


def power_loss(jobs: int, faults: int) -> Tally:
    """Everything ends at once, and of the disk there is what was synced: jobs go on, and have their
    pictures."""
    with (
        _loop_disk() as disk,
        Plant(disk.folder) as there,
        httpx.Client(base_url=there.url, timeout=20) as client,
    ):
        traffic = Traffic(there, jobs, pace_s=0.05).start()
        sent = []
        while traffic.sending:
            sent.append(picture(len(sent)))
            assert client.post("/v1/images", content=sent[-1]).status_code == 201
            time.sleep(0.1)
        known = {job_id: there.queue.get(job_id).created_at for job_id in traffic.ids}
        there.cut_power()
        disk.lose_what_is_not_synced()
        there.power_on()
        recovery_s = probe(there)
        found = _remembered(there, traffic, known)
        blobs = FolderBlobs(there.settings.blobs_dir, there.settings.blob_ttl_s)
        found.wrong += (damaged := sum(not _is_whole(blobs, data) for data in sent))
        found.worst_recovery_s = round(recovery_s, 2)
        found.note += f"; {damaged} of {len(sent)} pictures damaged"
        return found


def torn_log(jobs: int, faults: int) -> Tally:
    """The queue server is killed and its log ends in the middle of an entry, a second before."""
    with plant() as there:
        traffic = Traffic(there, jobs, pace_s=0.02).start()
        sizes: list[tuple[float, int]] = []
        while traffic.sending:
            sizes.append((time.monotonic(), _log_of(there).stat().st_size))
            time.sleep(0.1)
        known = {job_id: there.queue.get(job_id).created_at for job_id in traffic.ids}
        there.queue_server.kill()
        cut = next((size for when, size in reversed(sizes) if sizes[-1][0] - when > 1.1), 0)
        with _log_of(there).open("r+b") as file:
            file.truncate(max(cut - 7, 0))
        there.queue_server.start()
        recovery_s = probe(there)
        found = _remembered(there, traffic, known)
        found.worst_recovery_s = round(recovery_s, 2)
        return found


def _remembered(there: Plant, traffic: Traffic, known: dict) -> Tally:
    """Lost is what was not among the last jobs; what is remembered ends well."""
    remembered = {job.id for job in all_jobs(there)}
    gone = [job_id for job_id in known if job_id not in remembered]
    last = max(known.values())
    early = sum((last - known[job_id]).total_seconds() > _MAY_BE_FORGOTTEN_S for job_id in gone)
    for job_id in gone:
        del traffic.ids[job_id]
    found = traffic.tally(sent=len(known) - len(gone))
    found.lost += early
    found.jobs, found.faults = len(known), 1
    found.note = (
        f"{len(gone)} of the last second's jobs forgotten (appendfsync everysec), {early} older"
    )
    return found


def _is_whole(blobs: FolderBlobs, data: bytes) -> bool:
    try:
        return blobs.get(hashlib.sha256(data).hexdigest()) == data
    except BlobMissing:
        return False


def _log_of(there: Plant) -> Path:
    return max(
        (there.folder / "queue" / "appendonlydir").glob("*.incr.aof"), key=lambda file: file.name
    )


def full_disk(jobs: int, faults: int) -> Tally:
    """A small disk is filled to its last byte and freed again: refused meanwhile, nothing
    half-written."""
    with _small_disk() as disk, Plant(disk) as there:
        with httpx.Client(base_url=there.url, timeout=20) as client:
            first = client.post("/v1/images", content=picture(0)).status_code
            filler = disk / "filler"
            with contextlib.suppress(OSError), filler.open("wb", buffering=0) as file:
                while True:
                    file.write(bytes(65536))
            answers = [
                client.post("/v1/images", content=picture(1 + k)).status_code for k in range(jobs)
            ]
            filler.unlink()
            started = time.monotonic()
            wait_until(
                lambda: client.post("/v1/images", content=picture(-1)).status_code == 201, 60
            )
            recovery_s = max(time.monotonic() - started, probe(there))
        half = [file for file in (disk / "data" / "blobs").glob("??/*") if len(file.name) != 64]
        refused = sum(status == 507 for status in answers)
        note = f"first {first}, {refused} of {jobs} answered 507, {len(half)} half-written"
        wrong = (first != 201) + (jobs - refused) + len(half)
        return Tally(
            jobs=jobs, faults=1, wrong=wrong, worst_recovery_s=round(recovery_s, 2), note=note
        )


def slow_disk(jobs: int, faults: int) -> Tally:
    """Every sync takes a second, pictures come many at once: they are kept late, jobs without
    pictures are not."""
    with overlay(_SLOW) as env, plant(env=env) as there, ThreadPoolExecutor(jobs) as senders:

        def send(number: int) -> int:
            return httpx.post(
                f"{there.url}/v1/images", content=picture(number), timeout=120
            ).status_code

        waits = []
        answers: list[Future[int]] = [senders.submit(send, k) for k in range(jobs)]
        while not all(answer.done() for answer in answers):
            waits.append(probe(there))
        kept = sum(answer.result() == 201 for answer in answers)
        note = (
            f"{kept} of {jobs} pictures kept; seconds: the slowest of {len(waits)} no-ops meanwhile"
        )
        return Tally(
            jobs=jobs,
            faults=1,
            failed=jobs - kept,
            worst_recovery_s=round(max(waits), 2),
            note=note,
        )


@contextmanager
def _small_disk() -> Iterator[Path]:
    """16 MiB; needs the right to mount."""
    folder = Path(tempfile.mkdtemp(prefix="plant-disk-"))
    _run("mount", "-t", "tmpfs", "-o", "size=16m", "tmpfs", folder)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=False)
        folder.rmdir()


class LoopDisk:
    """A disk in a file: what its file system has not written to the file is what a loss of power
    takes.

    Its own writing is put off (``commit``), so that only what is synced on purpose reaches the
    file.
    """

    def __init__(self, place: Path) -> None:
        self._image = place / "disk"
        self.folder = place / "mounted"
        self.folder.mkdir()
        with self._image.open("wb") as file:
            file.truncate(256 * 2**20)
        _run("mkfs.ext4", "-q", "-F", self._image)
        self._mount()

    def lose_what_is_not_synced(self) -> None:
        """Nothing may be open on it."""
        as_it_is = self._image.with_name("synced")
        _run("cp", "--sparse=always", self._image, as_it_is)
        self.unmount()
        as_it_is.replace(self._image)
        self._mount()

    def unmount(self) -> None:
        _run("umount", self.folder)

    def _mount(self) -> None:
        _run("mount", "-o", "loop,commit=600", self._image, self.folder)


@contextmanager
def _loop_disk() -> Iterator[LoopDisk]:
    """Needs the right to mount, and loop devices."""
    place = Path(tempfile.mkdtemp(prefix="plant-power-"))
    disk = None
    try:
        disk = LoopDisk(place)
        yield disk
    finally:
        if disk:
            subprocess.run(["umount", "-l", str(disk.folder)], check=False)
        shutil.rmtree(place, ignore_errors=True)


def _run(*command: str | Path) -> None:
    """Raises SkippedError where the machine has no such program, or does not let us."""
    try:
        subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)
    except FileNotFoundError:
        raise SkippedError(f"{command[0]} is missing") from None
    except subprocess.CalledProcessError as error:
        raise SkippedError(f"{command[0]}: {error.stderr.strip()}") from error


def picture(number: int) -> bytes:
    """270 kB of noise, each number another."""
    buffer = io.BytesIO()
    Image.frombytes("RGB", (300, 300), random.Random(number).randbytes(270_000)).save(buffer, "BMP")
    return buffer.getvalue()
