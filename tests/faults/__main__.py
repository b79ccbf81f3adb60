"""``python -m tests.faults [--jobs 2000] [--kills 100] [--only kills,full_disk]``: make every fault
happen, and count.

A long run may come in pieces: ``--add`` adds what is counted to what the report holds, and each
``--seed`` has its own moments. Exits with 1 if a job was lost, doubled, wrong or failed without
reason. Writes ``build/bench/faults.json``.
"""

from __future__ import annotations

import argparse
import json
import os
import time
import traceback
from pathlib import Path
from typing import Any

from tests.faults.overlay import SkippedError
from tests.faults.scenarios import SCENARIOS, kills
from tests.faults.traffic import added

_SMALL = {
    "full_disk": 20,
    "slow_disk": 20,
    "client_gone": 20,
    "unreadable_weights": 20,
    "leaking_jobs": 40,
    "clock_jump": 50,
    "hanging_jobs": 50,
    "dripping_receivers": 20,
    "preempted": 60,
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--only", default="", help="names, separated by commas")
    parser.add_argument("--seed", type=int, default=1, help="of the moments at which kills come")
    parser.add_argument(
        "--add", action="store_true", help="to the counts of the report instead of replacing them"
    )
    parser.add_argument("--out", type=Path, default=Path("build/bench/faults.json"))
    asked = parser.parse_args()
    names = asked.only.split(",") if asked.only else list(SCENARIOS)
    known = json.loads(asked.out.read_text()) if asked.out.exists() else {}
    rows, bad = {}, []
    for name in names:
        rows[name] = _run(name, asked.jobs, asked.kills, asked.seed)
        print(f"{name:20} {rows[name]}", flush=True)
        if not rows[name]["good"]:
            bad.append(name)
        if asked.add and name in known:
            rows[name] = added(known[name], rows[name])
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.write_text(json.dumps(known | rows, indent=1))
    raise SystemExit(f"not as it should be: {', '.join(bad)}" if bad else 0)


def _run(name: str, jobs: int, faults: int, seed: int) -> dict[str, Any]:
    jobs = jobs if name == "kills" else min(jobs, _SMALL.get(name, 200))
    started = time.monotonic()
    try:
        tally = (
            kills(jobs, faults, seed)
            if name == "kills"
            else SCENARIOS[name](jobs, max(1, faults // 20))
        )
    except SkippedError as error:
        return {"good": True, "note": f"skipped: {error}"}
    except Exception as error:
        traceback.print_exc()
        return {"good": False, "note": f"{type(error).__name__}: {error}"}
    took_s, load = round(time.monotonic() - started, 1), round(os.getloadavg()[0], 1)
    return {"good": tally.good, **tally.row(), "took_s": took_s, "load": load}


if __name__ == "__main__":
    main()
