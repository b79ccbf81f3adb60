"""The deep run: ``python -m tests.properties --count 20000 [--kind plan_shape …]``; goes on after a
failure.

What became of the requests of each kind is added to ``build/bench/properties.json``, by kind and
seed.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import traceback
from collections import Counter
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

from tests.properties.judging import Bench
from tests.properties.requests import KINDS, Request

REPORT = Path("build/bench/properties.json")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=20_000, help="requests of all kinds together")
    parser.add_argument("--kind", action="append", choices=list(KINDS), help="default: every kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", type=int, default=20, help="failures written out")
    asked = parser.parse_args()
    kinds = asked.kind or list(KINDS)
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        failures = 0
        for kind in kinds:
            ended = _run(bench, kind, asked.count // len(kinds), asked.seed, asked.show)
            _keep(kind, asked.seed, ended)
            failures += ended["broken"]
    raise SystemExit(1 if failures else 0)


def _keep(kind: str, start: int, ended: Counter[str]) -> None:
    """The run of a kind with a seed takes the place of the one before it."""
    REPORT.parent.mkdir(parents=True, exist_ok=True)
    kept = json.loads(REPORT.read_text()) if REPORT.exists() else {}
    kept.setdefault(kind, {})[str(start)] = dict(ended)
    REPORT.write_text(json.dumps(kept))


def _run(bench: Bench, kind: str, count: int, start: int, show: int) -> Counter[str]:
    """What became of ``count`` requests; ``broken``: neither answered nor refused with a reason."""
    said: Counter[str] = Counter()
    kept: dict[str, str] = {}

    @seed(start)
    @settings(
        max_examples=count,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(KINDS[kind])
    def one(request: Request) -> None:
        try:
            said[bench.outcome(kind, request)] += 1
        except Exception as error:
            said["broken"] += 1
            place = traceback.extract_tb(error.__traceback__)[-1]
            name = f"{type(error).__name__} {Path(place.filename).name}:{place.lineno} {str(error)[:200]}"
            kept.setdefault(name.split(" ")[1] + type(error).__name__, f"{name}\n    {request}")

    one()
    print(kind, dict(said), flush=True)
    for text in list(kept.values())[:show]:
        print("  ", text[:1500], flush=True)
    return said


if __name__ == "__main__":
    main()
