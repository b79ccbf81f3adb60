"""How many files a request passes: which of ours run for one mask, and how often one hands over to
another.

    python -m tests.benchmarks.bench_files

Counts the files under ``models/`` whose functions run for a topology request, and the pairs of
files of which one calls the other. Prints both, the number of files in each part of ``models/``,
and every file with its calls.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import numpy as np

from models.synthesis.harness import HarnessParams
from models.synthesis.harness_growth import make_harness
from models.synthesis.harness_masks import MaskParams, draw_mask
from models.topology.extraction import extract
from tests.models.harnesses import shipped

ROOT = Path(__file__).parents[2]
SEED = 4


def passed(call: Callable[[], object]) -> tuple[Counter[str], set[tuple[str, str]]]:
    """Calls into each file under ``models/``, and the pairs of files of which one called the
    other."""
    calls: Counter[str] = Counter()
    pairs: set[tuple[str, str]] = set()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event != "call" or not (name := _ours(frame)):
            return
        calls[name] += 1
        caller = frame.f_back
        while caller is not None and not (above := _ours(caller)):
            caller = caller.f_back
        if caller is not None and above != name:
            pairs.add((above, name))

    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    return calls, pairs


def _ours(frame: FrameType) -> str:
    """The file of a frame, from ``models/`` on; empty for others'."""
    path = Path(frame.f_code.co_filename)
    return (
        path.relative_to(ROOT / "models").as_posix() if path.is_relative_to(ROOT / "models") else ""
    )


def main() -> None:
    rng = np.random.default_rng(SEED)
    mask = draw_mask(make_harness(rng, HarnessParams()), rng, MaskParams())
    network, classifiers = shipped()
    extract(mask, network, classifiers)
    calls, pairs = passed(lambda: extract(mask, network, classifiers))
    parts = Counter(name.split("/")[0] for name in calls)
    print(f"{len(calls)} files, {len(pairs)} pairs of which one calls the other")
    print(", ".join(f"{part} {count}" for part, count in sorted(parts.items())))
    for name, count in sorted(calls.items()):
        print(f"  {name}  {count} calls")


if __name__ == "__main__":
    main()
