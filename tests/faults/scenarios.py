"""The faults, one function each: makes it happen on a plant of its own and counts what became of
the jobs."""

from __future__ import annotations

import random
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import httpx

from tests.faults.disks import full_disk, picture, power_loss, slow_disk, torn_log
from tests.faults.overlay import clock, overlay
from tests.faults.peers import client_gone, dripping_clients, dripping_receivers
from tests.faults.plant import KINDS, Plant, plant
from tests.faults.traffic import COUNTED, Tally, Traffic, probe
from tests.processes import wait_until

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

_LEAK = """
import sys, time
_sleep, _kept = time.sleep, []
def sleep(seconds):
    if "workers.child" in sys.orig_argv:
        _kept.append(b"x" * (100 << 20))
    _sleep(seconds)
time.sleep = sleep
"""
_SLEEP = "import select, time\ntime.sleep = lambda seconds: select.select([], [], [], seconds)\n"
"""The library that sets the clock breaks the call that ``sleep`` makes by itself."""

_DAY_S = 86_400
_KILLED = 0.2


def kills(jobs: int, faults: int, seed: int = 1) -> Tally:
    """SIGKILL of child, worker, service and queue server in turn, at random moments, while jobs
    come in."""
    chance = random.Random(seed)
    with plant(workers=2, spare_child=True) as there:
        before = there.settled_mb()
        traffic = Traffic(there, jobs, pace_s=max(0.02, 2.0 * faults / jobs)).start()
        recovered = dict.fromkeys(KINDS, 0.0)
        for k in range(faults):
            time.sleep(chance.uniform(0.2, 1.0))
            there.kill(part := KINDS[k % len(KINDS)], chance)
            recovered[part] = max(recovered[part], round(probe(there), 2))
        found = traffic.tally()
        found.faults, found.recovery_s, found.worst_recovery_s = (
            faults,
            recovered,
            max(recovered.values()),
        )
        found.grown_mb = round(there.settled_mb() - before, 1)
    return found


def preempted(jobs: int, faults: int) -> Tally:
    """Interactive jobs come while batch jobs of a second run, which stand still; children and
    workers die."""
    chance, kills = random.Random(1), 0
    with plant(workers=2, spare_child=True, max_attempts=9) as there:
        there.settled_mb()
        traffic = Traffic(there, jobs, pace_s=0.02, shortest_s=1.0, priority="batch").start()
        waits = []
        while traffic.sending or there.queue.depth()["batch"]:
            time.sleep(chance.uniform(0.1, 0.6))
            if kills < faults and chance.random() < _KILLED:
                there.kill(("child", "worker")[kills % 2], chance)
                kills += 1
            waits.append(probe(there))
        found = traffic.tally()
        stood = round(there.queue.measures().counters.get(("preempted", "noop"), 0))
        found.faults, found.worst_recovery_s = kills, round(max(waits), 2)
        found.note = f"jobs stood still {stood} times; seconds: the slowest of {len(waits)} interactive no-ops"
        return found


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
    """Many more jobs than may wait: refused with 429 and a time to come back; all are done in the
    end."""
    with plant(max_queue_depth=5) as there:
        senders = [Traffic(there, max(1, jobs // 4), pace_s=0.0).start() for _ in range(4)]
        started = time.monotonic()
        parts = [sender.tally() for sender in senders]
        return Tally(
            jobs=sum(part.jobs for part in parts),
            lost=sum(part.lost for part in parts),
            faults=1,
            wrong=sum(part.wrong for part in parts),
            failed=sum(part.failed for part in parts),
            doubled=sum(part.doubled for part in parts),
            worst_recovery_s=round(time.monotonic() - started, 2),
            note="seconds are those of the whole flood",
        )


def clock_jump(jobs: int, faults: int) -> Tally:
    """Workers and service whose clocks are a day and a half ahead: jobs and pictures live by the
    server's."""
    with overlay(_SHIFT.format(seconds=130_000)) as env, plant(env=env) as there:
        with httpx.Client(base_url=there.url, timeout=20) as client:
            image = client.post("/v1/images", content=picture(0)).json()["id"]
            found = Traffic(there, jobs, pace_s=0.02).start().tally()
            kept = (
                client.post(
                    "/v1/jobs", json={"kind": "segment", "image": {"id": image}}
                ).status_code
                == 202
            )
        found.faults, found.wrong = 1, found.wrong + (not kept)
        found.note = "the picture is still there" if kept else "the picture was swept"
        return found


def clock_steps(jobs: int, faults: int) -> Tally:
    """The clock of the whole machine is set a day on, and two days back, while jobs run: later ones
    are as before."""
    with clock() as step, overlay(_SLEEP) as env, plant(env=env) as there:
        recovered = []
        found = Traffic(there, jobs, pace_s=0.02).start().tally()
        for offset_s in (_DAY_S, -_DAY_S):
            step(offset_s)
            recovered.append(probe(there))
            more = Traffic(there, jobs, pace_s=0.02).start().tally()
            found = Tally(**{name: getattr(found, name) + getattr(more, name) for name in COUNTED})
        found.faults, found.worst_recovery_s = 2, round(max(recovered), 2)
        return found


def unreadable_weights(jobs: int, faults: int) -> Tally:
    """A worker that cannot read its networks is never ready and does not take jobs; once it can, it
    does them."""
    with tempfile.TemporaryDirectory() as folder:
        allowed = Path(folder) / "allowed"
        with overlay(_UNREADABLE.format(allowed=str(allowed))) as env:
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


def hanging_jobs(jobs: int, faults: int) -> Tally:
    """Jobs that never end are stopped at their time limit, and hold up the next one by no more than
    that."""
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


def leaking_jobs(jobs: int, faults: int) -> Tally:
    """Each job leaves 100 MB behind in a child that may take 2 GB: it is replaced before that, and
    nobody fails."""
    with overlay(_LEAK) as env, plant(env=env, child_memory_mb=2000, spare_child=True) as there:
        found = Traffic(there, jobs, pace_s=0.1).start().tally()
        found.faults, found.worst_recovery_s = jobs, round(probe(there), 2)
        return found


SCENARIOS: dict[str, Callable[[int, int], Tally]] = {
    scenario.__name__: scenario
    for scenario in (
        kills,
        preempted,
        power_loss,
        torn_log,
        full_disk,
        slow_disk,
        frozen_queue,
        full_queue,
        clock_jump,
        clock_steps,
        unreadable_weights,
        client_gone,
        hanging_jobs,
        leaking_jobs,
        dripping_clients,
        dripping_receivers,
    )
}
