"""``python -m tests.benchmarks.bench_chroma_key [SHARED]``: the chroma key on real pictures before a green mat.

``bwh`` (25 pictures of harnesses on a glossy mat under lamps): ranges found for each of its recordings, Dice of the
keyed masks, and in how many pictures the warning about the screen's own hue fires: with a green wire it should.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from models.synthesis.chroma_key import key
from models.synthesis.chroma_ranges import find_ranges
from tests.benchmarks.bench_foreground import pictures, score


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    recordings: dict[str, list] = {}
    for name, image, true in pictures(args.shared / "data" / "bwh", "masks"):
        recordings.setdefault(name.split("_")[0], []).append((name, image, true))
    report: dict = {"recordings": {}}
    every = []
    for recording, shots in recordings.items():
        ranges = find_ranges([image for _, image, _ in shots])
        keyed = [key(image, ranges) for _, image, _ in shots]
        dice = [score(k.mask, true)["dice"] for k, (_, _, true) in zip(keyed, shots, strict=True)]
        every += dice
        report["recordings"][recording] = {
            "n": len(shots),
            "dice": round(100 * float(np.mean(dice)), 2),
            "worst": round(100 * min(dice), 2),
            "warned": sum(k.screen_hue for k in keyed),
        }
    report["dice"] = round(100 * float(np.mean(every)), 2)
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "chroma_key.json").write_text(json.dumps(report, indent=1))
    print(json.dumps(report))


if __name__ == "__main__":
    main()
