"""``python -m tests.faults [--jobs 2000] [--kills 100] [--only kills,full_disk]``: make every fault happen, and count.

Exits with 1 if a job was lost, doubled, wrong or failed without reason. Writes ``build/bench/faults.json``.
"""

from __future__ import annotations

import argparse
import json
import time
import traceback
from pathlib import Path
from typing import Any

from tests.faults.scenarios import SCENARIOS, SkippedError

_SMALL = {"full_disk": 20, "client_gone": 20, "unreadable_weights": 20, "clock_jump": 50, "hanging_jobs": 50}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=2000)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--only", default="", help="names, separated by commas")
    parser.add_argument("--out", type=Path, default=Path("build/bench/faults.json"))
    asked = parser.parse_args()
    names = asked.only.split(",") if asked.only else list(SCENARIOS)
    rows, bad = {}, []
    for name in names:
        rows[name] = _run(name, asked.jobs, asked.kills)
        print(f"{name:20} {rows[name]}", flush=True)
        if not rows[name]["good"]:
            bad.append(name)
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    known = json.loads(asked.out.read_text()) if asked.out.exists() else {}
    asked.out.write_text(json.dumps(known | rows, indent=1))
    raise SystemExit(f"not as it should be: {', '.join(bad)}" if bad else 0)


def _run(name: str, jobs: int, kills: int) -> dict[str, Any]:
    jobs = jobs if name == "kills" else min(jobs, _SMALL.get(name, 200))
    started = time.monotonic()
    try:
        tally = SCENARIOS[name](jobs, kills if name == "kills" else max(1, kills // 20))
    except SkippedError as error:
        return {"good": True, "note": f"skipped: {error}"}
    except Exception as error:
        traceback.print_exc()
        return {"good": False, "note": f"{type(error).__name__}: {error}"}
    return {"good": tally.good, **tally.row(), "took_s": round(time.monotonic() - started, 1)}


if __name__ == "__main__":
    main()
