"""``python -m tests.load [--rates 5,10,20] [--seconds 20] [--soak 600]``: jobs at a rate that waits
for no answer.

Open loop: a job is sent when it is due, however slow the answers are, and its time counts from when
it was due. The soak then goes on at half of the highest rate that was kept. Writes
``build/bench/load.json``; exits with 1 if a job was lost or failed.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import httpx
import numpy as np

from tests.faults.plant import Plant, plant

_KEPT_WITHIN_S = 1.0
_WARM_UP_S = 10.0
_PICTURE = Path(__file__).parent.parent / "samples" / "plain.jpg"


@dataclass
class Rate:
    """What came of one rate; milliseconds from when a job was due to its end."""

    kind: str
    per_s: float
    jobs: int
    refused: int
    lost: int
    failed: int
    p50_ms: float
    p95_ms: float
    worst_ms: float

    @property
    def kept(self) -> bool:
        return (
            not (self.refused or self.lost or self.failed) and self.p95_ms < _KEPT_WITHIN_S * 1000
        )


async def _send(
    client: httpx.AsyncClient, body: dict, due: float, found: list[float], bad: dict[str, int]
) -> None:
    await asyncio.sleep(max(0.0, due - time.monotonic()))
    try:
        answer = await client.post("/v1/jobs?wait=60", json=body)
        state = answer.json().get("state") if answer.status_code == 200 else None
    except httpx.HTTPError:
        bad["lost"] += 1
        return
    if answer.status_code == 429:
        bad["refused"] += 1
    elif state == "succeeded":
        found.append((time.monotonic() - due) * 1000)
    else:
        bad["failed" if state else "lost"] += 1


async def at_rate(there: Plant, body: dict, per_s: float, seconds: float) -> Rate:
    """Send for so long, and wait for the last answer."""
    found: list[float] = []
    bad = {"lost": 0, "refused": 0, "failed": 0}
    jobs = max(1, round(per_s * seconds))
    limits = httpx.Limits(max_connections=None, max_keepalive_connections=100)
    async with httpx.AsyncClient(base_url=there.url, timeout=90, limits=limits) as client:
        begin = time.monotonic() + 0.1
        await asyncio.gather(
            *(_send(client, body, begin + k / per_s, found, bad) for k in range(jobs))
        )
    p50, p95 = np.percentile(found, (50, 95)) if found else (np.inf, np.inf)
    return Rate(
        kind=body["kind"],
        per_s=per_s,
        jobs=jobs,
        p50_ms=round(float(p50), 1),
        p95_ms=round(float(p95), 1),
        worst_ms=round(max(found, default=float("inf")), 1),
        **bad,
    )


def soak(there: Plant, body: dict, per_s: float, seconds: float) -> dict[str, object]:
    """Memory of every part after a warm-up and at the end, beside what came of the jobs."""
    asyncio.run(at_rate(there, body, per_s, _WARM_UP_S))
    before = there.memory_mb()
    rate = asyncio.run(at_rate(there, body, per_s, seconds))
    after = there.memory_mb()
    grown = {name: round(100 * (after[name] / before[name] - 1), 2) for name in before}
    return {"seconds": seconds, **asdict(rate), "memory_mb": after, "grown_percent": grown}


def bodies(there: Plant) -> dict[str, Callable[[], dict]]:
    """A request of each kind that is sent here."""

    def instances() -> dict:
        image = httpx.post(f"{there.url}/v1/images", content=_PICTURE.read_bytes()).json()["id"]
        return {"kind": "instances", "image": {"id": image}, "files": []}

    return {"noop": lambda: {"kind": "noop"}, "instances": instances}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kind", choices=("noop", "instances"), default="noop")
    parser.add_argument("--rates", default="5,10,20,40,80,160")
    parser.add_argument("--seconds", type=float, default=20.0, help="for each rate")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--soak", type=float, default=0.0, help="seconds; 600 for the ten minutes")
    parser.add_argument("--out", type=Path, default=Path("build/bench/load.json"))
    asked = parser.parse_args()
    with plant(workers=asked.workers) as there:
        body = bodies(there)[asked.kind]()
        rates = []
        for per_s in map(float, asked.rates.split(",")):
            rates.append(asyncio.run(at_rate(there, body, per_s, asked.seconds)))
            print(rates[-1], flush=True)
            if not rates[-1].kept:
                break
        kept = max((rate.per_s for rate in rates if rate.kept), default=1.0)
        result: dict[str, object] = {
            "workers": asked.workers,
            "kept_per_s": kept,
            "rates": [asdict(rate) for rate in rates],
        }
        if asked.soak:
            result["soak"] = soak(there, body, kept / 2, asked.soak)
            print(result["soak"], flush=True)
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    known = json.loads(asked.out.read_text()) if asked.out.exists() else {}
    asked.out.write_text(json.dumps(known | {asked.kind: result}, indent=1))
    raise SystemExit(1 if any(rate.lost or rate.failed for rate in rates) else 0)


if __name__ == "__main__":
    main()
