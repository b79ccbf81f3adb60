"""Jobs with answers that are known, sent by clients that go on through every outage; and what
became of them."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from typing import Any
from uuid import uuid4

import httpx
from dlo_client.contracts import AnyJob

from tests.faults.plant import Plant

_PATIENCE_S = 180.0
_TIMEOUT_S = 600.0


COUNTED = ("lost", "doubled", "wrong", "failed", "jobs", "faults")
"""Fields of a :class:`Tally` that add up."""


@dataclass
class Tally:
    """What became of the jobs of one scenario; the first four should be 0."""

    lost: int = 0
    """Accepted, and never ended."""
    doubled: int = 0
    """Ended well more than once, or one key made two jobs."""
    wrong: int = 0
    failed: int = 0
    """Ended badly although nothing was wrong with them."""
    jobs: int = 0
    faults: int = 0
    worst_recovery_s: float = 0.0
    """From a fault until a job that was sent right after it had ended."""
    recovery_s: dict[str, float] = field(default_factory=dict)
    """The worst of each part that was killed."""
    grown_mb: float = 0.0
    note: str = ""

    def row(self) -> dict[str, object]:
        return asdict(self)

    @property
    def good(self) -> bool:
        return not (self.lost or self.doubled or self.wrong or self.failed)


def added(known: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    """Two rows of a report as one: counts added, the worst of the times, of the growth and of the
    load."""
    if "jobs" not in known or "jobs" not in more:
        return known if "jobs" in known else more
    return {
        "good": known["good"] and more["good"],
        **{name: round(known[name] + more[name], 1) for name in (*COUNTED, "took_s")},
        **{
            name: max(known.get(name, 0.0), more[name])
            for name in ("worst_recovery_s", "grown_mb", "load")
        },
        "recovery_s": known.get("recovery_s", {})
        | {
            part: max(s, known.get("recovery_s", {}).get(part, 0.0))
            for part, s in more["recovery_s"].items()
        },
        "note": more["note"],
    }


class Traffic:
    """Sends ``jobs`` no-op jobs, each of its own length, at a steady pace from a thread."""

    def __init__(
        self,
        plant: Plant,
        jobs: int,
        pace_s: float,
        shortest_s: float = 0.01,
        priority: str = "interactive",
    ) -> None:
        self._plant = plant
        self._pace_s = pace_s
        self._priority = priority
        self._holds = [shortest_s + 1e-5 * k for k in range(jobs)]
        self.ids: dict[str, float] = {}
        """Of accepted jobs, and how long each holds its worker."""
        self._label = f"traffic {uuid4().hex[:8]}"
        self._thread = threading.Thread(target=self._send_all, daemon=True)

    @property
    def sending(self) -> bool:
        return self._thread.is_alive()

    def start(self) -> Traffic:
        self._thread.start()
        return self

    def _send_all(self) -> None:
        with httpx.Client(base_url=self._plant.url, timeout=20) as client:
            for hold_s in self._holds:
                self.ids[send(client, hold_s, self._label, self._priority)] = hold_s
                time.sleep(self._pace_s)

    def tally(self, sent: int | None = None) -> Tally:
        """Wait for the last job to end, then count; ``sent``: how many should be there, by default
        all."""
        self._thread.join(_PATIENCE_S)
        sent = len(self._holds) if sent is None else sent
        found = Tally(jobs=sent, lost=sent - len(self.ids))
        give_up = time.monotonic() + _PATIENCE_S
        for job_id, hold_s in self.ids.items():
            while (
                not (job := self._plant.queue.get(job_id)).state.final
                and time.monotonic() < give_up
            ):
                self._plant.tend()
                time.sleep(0.02)
            finals = sum(event.state.final for event in self._plant.queue.events(job_id))
            found.lost += not job.state.final
            found.failed += job.state.final and job.state != "succeeded"
            found.wrong += job.state == "succeeded" and (
                job.result is None or job.result.held_s != hold_s
            )
            found.doubled += finals > 1
        found.doubled += sum(job.label == self._label for job in all_jobs(self._plant)) - len(
            self.ids
        )
        return found


def all_jobs(plant: Plant) -> Iterator[AnyJob]:
    """Every job that is remembered, newest first."""
    cursor = None
    while True:
        page = plant.queue.recent(limit=200, cursor=cursor)
        yield from page.jobs
        if (cursor := page.next_cursor) is None:
            return


def send(client: httpx.Client, hold_s: float, label: str, priority: str) -> str:
    """Submit until it is accepted, as a client does that was told nothing: with one key; the job's
    id."""
    body = {
        "kind": "noop",
        "hold_s": hold_s,
        "timeout_s": _TIMEOUT_S,
        "label": label,
        "priority": priority,
    }
    key, give_up = uuid4().hex, time.monotonic() + _PATIENCE_S
    while time.monotonic() < give_up:
        try:
            answer = client.post("/v1/jobs", json=body, headers={"Idempotency-Key": key})
            if answer.status_code in (200, 202):
                return str(answer.json()["id"])
            if answer.status_code not in (429, 503):
                raise AssertionError(f"{answer.status_code}: {answer.text[:300]}")
            time.sleep(0.2)
        except httpx.HTTPError:
            pass
        time.sleep(0.05)
    raise AssertionError(f"not accepted within {_PATIENCE_S:g} s")


def probe(plant: Plant) -> float:
    """Seconds until a job that is sent now has ended; starts again what has ended."""
    started = time.monotonic()
    with httpx.Client(base_url=plant.url, timeout=5) as client:
        while True:
            plant.tend()
            try:
                answer = client.post("/v1/jobs?wait=2", json={"kind": "noop", "timeout_s": 600.0})
                if answer.status_code == 200:
                    return time.monotonic() - started
            except httpx.HTTPError:
                pass
            assert time.monotonic() - started < _PATIENCE_S, "does not recover"
            time.sleep(0.05)
