"""``python -m tests.rehearsal.hosts [--rate 60]``: jobs on several hosts, whose cables are pulled
one by one.

The hosts are those of :mod:`tests.rehearsal.deployment`. ``--rate N`` compares besides N jobs on
one host with a worker and on two: once with real work, once with a wait of ``--wait`` seconds in
its place. Writes ``build/bench/hosts.json``; exits with 1 if a job was lost, doubled or wrong, and
with 0 and a word on why where the machine lets nobody make hosts.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

import httpx

from tests.processes import ROOT, wait_until
from tests.rehearsal import rates
from tests.rehearsal.network import NoNamespacesError, go_inside

_PICTURE = ROOT / "tests" / "samples" / "plain.jpg"
_PATIENCE_S = 240.0
Row = dict[str, Any]


def _send(client: httpx.Client, body: Row) -> str:
    """Submit until it is accepted, always with the same key; the job's id."""
    key, give_up = uuid4().hex, time.monotonic() + _PATIENCE_S
    while time.monotonic() < give_up:
        try:
            answer = client.post(
                "/v1/jobs",
                json={"timeout_s": 900.0} | body,
                headers={"Idempotency-Key": key},
                timeout=10,
            )
            if answer.status_code in (200, 202):
                return str(answer.json()["id"])
            assert answer.status_code in (429, 503), answer.text[:300]
        except httpx.HTTPError:
            pass
        time.sleep(0.1)
    raise AssertionError("not accepted")


def _ended(client: httpx.Client, ids: list[str]) -> list[Row]:
    """The jobs, once all are over."""
    jobs = []
    for job_id in ids:

        def over(job_id: str = job_id) -> Row | None:
            try:
                job: Row = client.get(f"/v1/jobs/{job_id}", timeout=10).json()
            except httpx.HTTPError:
                return None
            return job if job.get("state") in ("succeeded", "failed", "cancelled") else None

        jobs.append(wait_until(over, _PATIENCE_S))
    return jobs


def _run(
    client: httpx.Client, bodies: list[Row], meanwhile: Callable[[], object] = lambda: None
) -> Row:
    """Counts of what became of jobs that are sent, then ``meanwhile``."""
    started = time.monotonic()
    ids = [_send(client, body) for body in bodies]
    meanwhile()
    jobs = _ended(client, ids)
    bad = sum(job["state"] != "succeeded" for job in jobs)
    again = sum(job["attempts"] > 1 for job in jobs)
    return {
        "jobs": len(jobs),
        "bad": bad,
        "taken up again": again,
        "s": round(time.monotonic() - started, 1),
    }


def spread(there: Any) -> Row:
    """Pictures sent to one replica are worked on by both hosts, and their files come from either
    replica."""
    image = there.client.post("/v1/images", content=_PICTURE.read_bytes()).json()["id"]
    row = _run(there.client, [{"kind": "instances", "image": {"id": image}}] * 12)
    jobs = there.client.get("/v1/jobs?kind=instances").json()["jobs"]
    sizes = {
        len(there.client.get(f"/v1/jobs/{jobs[0]['id']}/files/overlay.png").content)
        for _ in range(4)
    }
    done = [there.log_of(number).count('"event": "job succeeded"') for number in there.workers]
    assert len(sizes) == 1
    return row | {"by host": done, "bad": row["bad"] + (min(done) == 0)}


def stranger(there: Any) -> Row:
    """A worker with another folder of the bucket does not join, and names the folder."""
    there.work(there.stranger, DLO_BLOBS_URL="s3://dlo/elsewhere")
    wait_until(lambda: "s3://dlo/elsewhere" in there.log_of(there.stranger), _PATIENCE_S)
    row = _run(there.client, [{"kind": "noop"}] * 10)
    there.stop(there.stranger)
    return row | {"bad": row["bad"] + ("job succeeded" in there.log_of(there.stranger))}


def worker_unplugged(there: Any) -> Row:
    """The cable of a host with a worker: its jobs are taken up by the other; plugged in again it
    goes on."""
    host = there.hosts[there.workers[1]]
    row = _run(there.client, [{"kind": "noop", "hold_s": 1.0}] * 8, host.unplug)
    before = there.log_of(there.workers[1]).count('"event": "job succeeded"')
    host.plug()
    started = time.monotonic()

    def works() -> bool:
        _run(there.client, [{"kind": "noop", "hold_s": 0.2}] * 4)
        return there.log_of(there.workers[1]).count('"event": "job succeeded"') > before

    wait_until(works, _PATIENCE_S)
    return row | {"back after s": round(time.monotonic() - started, 1)}


def replica_unplugged(there: Any) -> Row:
    """The cable of one replica of the service: the other answers."""
    host = there.hosts[there.services[0]]
    host.unplug()
    row = _run(there.client, [{"kind": "noop"}] * 10)
    host.plug()
    wait_until(there.ready, _PATIENCE_S)
    return row


def bucket_unplugged(there: Any) -> Row:
    """The cable of the S3 server: new pictures are refused with a reason, jobs without go on, then
    all is as before. One that was there within the last minute would be taken for granted."""
    host = there.hosts[there.bucket]
    another = _PICTURE.read_bytes() + b"behind the end of the picture"
    host.unplug()
    refused = there.client.post("/v1/images", content=another)
    row = _run(there.client, [{"kind": "noop"}] * 5)
    host.plug()
    wait_until(
        lambda: there.client.post("/v1/images", content=another).status_code == 201, _PATIENCE_S
    )
    unclear = (refused.status_code, refused.json()["code"]) != (503, "storage_unavailable")
    return row | {"bad": row["bad"] + unclear}


def queue_unplugged(there: Any) -> Row:
    """The cable of the queue server, for three seconds, while jobs run."""
    host = there.hosts[there.queue]

    def off_and_on() -> None:
        host.unplug()
        time.sleep(3)
        host.plug()

    return _run(there.client, [{"kind": "noop", "hold_s": 0.5}] * 8, off_and_on)


def _rates(there: Any, jobs: int, wait_s: float) -> Iterator[tuple[str, Row]]:
    yield "timed", rates.timed(there, jobs, wait_s)
    yield "rate", rates.computed(there, jobs)


PARTS = (spread, stranger, worker_unplugged, replica_unplugged, bucket_unplugged, queue_unplugged)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rate", type=int, default=0, metavar="N", help="jobs")
    parser.add_argument(
        "--wait", type=float, default=0.15, help="seconds, in place of the work of a job"
    )
    parser.add_argument(
        "--only", default=",".join(part.__name__ for part in PARTS), help="names, or nothing"
    )
    parser.add_argument("--out", type=Path, default=Path("build/bench/hosts.json"))
    asked = parser.parse_args()
    try:
        go_inside()
        from tests.rehearsal.deployment import Hosts

        folder = Path(tempfile.mkdtemp(prefix="hosts-"))
        there = Hosts(folder)
    except NoNamespacesError as error:
        raise SystemExit(print(f"skipped: {error}")) from None
    known = json.loads(asked.out.read_text()) if asked.out.exists() else {}
    found: Row = {}
    try:
        there.begin()
        for part in PARTS:
            if part.__name__ in asked.only.split(","):
                found[part.__name__] = part(there)
                print(part.__name__, found[part.__name__], flush=True)
        if asked.rate:
            for name, measured in _rates(there, asked.rate, asked.wait):
                found[name] = measured
                print(name, measured, flush=True)
    finally:
        there.end()
        shutil.rmtree(folder, ignore_errors=True)
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.write_text(json.dumps(known | found, indent=1))
    raise SystemExit(1 if any(row["bad"] for row in found.values()) else 0)


if __name__ == "__main__":
    main()
