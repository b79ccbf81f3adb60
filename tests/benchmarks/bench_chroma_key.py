"""``python -m tests.benchmarks.bench_chroma_key [SHARED]``: the chroma key on real pictures before
a green mat.

``bwh`` (25 pictures of harnesses on a glossy mat under lamps): ranges found for each of its
recordings, Dice of the keyed masks, and in how many pictures the warning about the screen's own hue
fires: with a green wire it should. ``chosen``: the ranges picked as well as one can on every other
picture of a recording (the page shows six), Dice on the rest, beside that of the found ranges on
the same pictures.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from models.synthesis.chroma_key import key
from models.synthesis.chroma_ranges import ScreenRanges, find_ranges, foreground, to_hsv
from tests.benchmarks.bench_foreground import pictures, score

_STEPS = {
    "hue_deg": (-16.0, -8.0, -4.0, 4.0, 8.0, 16.0),
    "saturation": (-0.1, -0.04, 0.04, 0.1),
    "value": (-0.15, -0.06, 0.06, 0.15),
}


def chosen(shots: Sequence, ranges: ScreenRanges) -> ScreenRanges:
    """Every bound moved in turn while the masks get better, as who moves six sliders does."""
    seen = [(to_hsv(image), true) for _, image, true in shots]

    def rate(ranges: ScreenRanges) -> float:
        return float(np.mean([score(foreground(hsv, ranges), true)["dice"] for hsv, true in seen]))

    best, improved = rate(ranges), True
    while improved:
        improved = False
        for name, steps in _STEPS.items():
            for end in (0, 1):
                for step in steps:
                    moved = _moved(ranges, name, end, step)
                    dice = rate(moved)
                    if dice > best + 1e-4:
                        best, ranges, improved = dice, moved, True
    return ranges


def _moved(ranges: ScreenRanges, name: str, end: int, step: float) -> ScreenRanges:
    bounds = list(getattr(ranges, name))
    bounds[end] += step
    return replace(ranges, **{name: tuple(bounds)})


def dice_of(shots: Sequence, ranges: ScreenRanges) -> list[float]:
    return [score(key(image, ranges).mask, true)["dice"] for _, image, true in shots]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    recordings: dict[str, list] = {}
    for name, image, true in pictures(args.shared / "data" / "bwh", "masks"):
        recordings.setdefault(name.split("_")[0], []).append((name, image, true))
    report: dict = {"recordings": {}}
    every, found, picked = [], [], []
    for recording, shots in recordings.items():
        ranges = find_ranges([image for _, image, _ in shots])
        keyed = [key(image, ranges) for _, image, _ in shots]
        dice = [score(k.mask, true)["dice"] for k, (_, _, true) in zip(keyed, shots, strict=True)]
        every += dice
        found += dice[1::2]
        picked += dice_of(shots[1::2], chosen(shots[::2], ranges))
        report["recordings"][recording] = {
            "n": len(shots),
            "dice": round(100 * float(np.mean(dice)), 2),
            "worst": round(100 * min(dice), 2),
            "warned": sum(k.screen_hue for k in keyed),
        }
    for name, values in (("found_on_the_others", found), ("chosen", picked)):
        report[name] = round(100 * float(np.mean(values)), 2)
    report["dice"] = round(100 * float(np.mean(every)), 2)
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "chroma_key.json").write_text(json.dumps(report, indent=1))
    print(json.dumps(report))


if __name__ == "__main__":
    main()
