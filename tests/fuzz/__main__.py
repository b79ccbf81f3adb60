"""``python -m tests.fuzz --count 10000 [--seed 1] [--only requests,damaged,pictures,schema]``:
through the whole path.

* ``requests``: valid requests of every kind, by strategy; each accepted one is done.
* ``damaged``: the same with a few places of their JSON changed.
* ``pictures``: pictures of every encoding, damaged; each accepted one is segmented.
* ``schema``: what schemathesis makes of the OpenAPI document for the two POST routes.

Never a 5xx, an internal error, NaN, or an answer that its contract does not allow. What breaks is
written to ``tests/fuzz/seeds``, which the tests try again from then on. Counts are in
``build/bench/fuzz.json``; a long run may come in pieces, ``--add`` with another ``--seed`` each.
Exits with 1 if anything broke.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import random
import re
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import schemathesis
import structlog
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from schemathesis import GenerationMode
from schemathesis.specs.openapi.checks import response_schema_conformance, status_code_conformance

from tests.fuzz.bench import Whole, whole
from tests.fuzz.mutations import damaged_bytes, damaged_request
from tests.properties.pictures import pool
from tests.properties.requests import KINDS
from tests.services.samples import ACCEPTED, REFUSED

_INCIDENT = re.compile(r"[0-9a-f]{16,}")
SEEDS = Path(__file__).parent / "seeds"


class Run:
    """Tries bodies one by one, counts what comes of them, keeps what breaks."""

    def __init__(self, there: Whole, keep: Path) -> None:
        self.there = there
        self.ended: Counter[str] = Counter()
        self._keep = keep
        self._known: set[str] = set()

    def try_one(self, body: bytes, send: Callable[[bytes], str], kind: str) -> None:
        try:
            self.ended[send(body)] += 1
        except Exception as error:
            self.ended["broken"] += 1
            place = traceback.extract_tb(error.__traceback__)[-1]
            told = _INCIDENT.sub("…", str(error))[:200]
            name = f"{type(error).__name__} {Path(place.filename).name}:{place.lineno} {told}"
            if name not in self._known:
                self._known.add(name)
                self._keep.mkdir(parents=True, exist_ok=True)
                (self._keep / f"{hashlib.sha256(body).hexdigest()[:16]}.{kind}").write_bytes(body)
                print("  broken:", name, flush=True)


def requests(run: Run, count: int, start: int) -> None:
    _generated(
        count,
        start,
        lambda body: run.try_one(json.dumps(body).encode(), run.there.submit, "json"),
        run,
    )


def damaged(run: Run, count: int, start: int) -> None:
    chance = random.Random(start)

    def one(body: dict) -> None:
        run.try_one(damaged_request(body, chance), run.there.submit, "json")

    _generated(count, start + 1, one, run)


def _generated(count: int, start: int, one: Callable[[dict], None], run: Run) -> None:
    for kind, strategy in KINDS.items():

        def each(request: dict, kind: str) -> None:
            one(run.there.with_pictures(kind, request))

        _examples(count // len(KINDS), start)(given(strategy, st.just(kind))(each))()


def _examples(count: int, start: int) -> Callable[[Callable[[], None]], Callable[[], None]]:
    """That many, the same ones for the same ``start``, one after the other."""
    chosen = settings(
        max_examples=max(1, count),
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    return lambda test: seed(start)(chosen(test))


def pictures(run: Run, count: int, start: int) -> None:
    chance = random.Random(start)
    originals = [*ACCEPTED.values(), *REFUSED.values(), *(data for data, _ in pool().values())]
    originals = [data for data in originals if 0 < len(data) < 200_000]
    for _ in range(count):
        data = damaged_bytes(chance.choice(originals), chance, chance.choice(originals))
        run.try_one(data, run.there.upload, "picture")


def schema(run: Run, count: int, start: int) -> None:
    document = schemathesis.openapi.from_url(str(run.there.client.base_url.join("/openapi.json")))

    def each(case: schemathesis.Case) -> None:
        if case.query and "wait" in case.query:
            case.query["wait"] = "0"

        def send(_: bytes) -> str:
            answer = case.call()
            assert answer.status_code < 500, answer.status_code
            case.validate_response(
                answer, checks=[status_code_conformance, response_schema_conformance]
            )
            return f"answered {answer.status_code}"

        run.try_one(repr(case.body).encode(), send, "case")

    for path in ("/v1/jobs", "/v1/images"):
        for mode in GenerationMode:
            strategy = document[path]["POST"].as_strategy(generation_mode=mode)
            _examples(count // 4, start)(given(strategy)(each))()


PARTS: dict[str, Callable[[Run, int, int], None]] = {
    part.__name__: part for part in (requests, damaged, pictures, schema)
}


def kept() -> list[Path]:
    """What once broke."""
    return [file for file in sorted(SEEDS.iterdir()) if file.suffix in (".json", ".picture")]


def note(out: Path, part: str, start: int, ended: Counter[str], *, add: bool) -> None:
    """Write what came of a part into the report; with ``add`` to what other seeds gave."""
    known = json.loads(out.read_text()) if out.exists() else {"parts": {}, "seeds": []}
    before = Counter(known["parts"].get(part, {})) if add else Counter()
    known["parts"][part] = before + ended
    known["seeds"] = sorted({*known["seeds"], start}) if add else [start]
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(known, indent=1))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000, help="of all parts together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="names of parts, separated by commas")
    parser.add_argument(
        "--add", action="store_true", help="to the counts of the report instead of replacing them"
    )
    parser.add_argument("--out", type=Path, default=Path("build/bench/fuzz.json"))
    parser.add_argument("--keep", type=Path, default=SEEDS)
    asked = parser.parse_args()
    structlog.configure(logger_factory=structlog.ReturnLoggerFactory())
    names = asked.only.split(",") if asked.only else list(PARTS)
    broken = 0
    with tempfile.TemporaryDirectory() as folder, whole(Path(folder)) as there:
        for name in names:
            run = Run(there, asked.keep)
            PARTS[name](run, asked.count // len(names), asked.seed)
            print(name, sum(run.ended.values()), dict(run.ended.most_common()), flush=True)
            broken += run.ended["broken"]
            note(asked.out, name, asked.seed, run.ended, add=asked.add)
    raise SystemExit(1 if broken else 0)


if __name__ == "__main__":
    main()
