"""The default instance method against that of an earlier commit, on the same masks, in turn.

    python -m tests.benchmarks.bench_before SHARED [--commit C] [--rounds N]

The published masks of ``ewd`` at their threshold, with their pictures, one thread. The earlier tree
is exported from the history (default: the last commit of the first release). Each round runs both
in processes of their own; a round's ratio is that of the medians over its repeats. Both processes
have freed something large before, as one that has seen a picture has: without it how often memory
goes back and forth is chance. Prints a table and writes ``build/bench/before.json``.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.benchmarks.bench_instances import photos

FIRST_RELEASE = "5f4aea4"
_REPEATS = 4
_TIMED = f"""
import sys, time
import cv2, numpy as np
cv2.setNumThreads(1)
np.ones(31 << 20, np.uint8)
from models.instances.section_matching import extract
with np.load(sys.argv[1]) as file:
    pairs = [(file[f"mask{{k}}"], file[f"image{{k}}"]) for k in range(len(file.files) // 2)]
took_ms = []
for _ in range({_REPEATS} + 1):
    started = time.process_time()
    for mask, image in pairs:
        extract(mask, image)
    took_ms.append(1e3 * (time.process_time() - started) / len(pairs))
print(np.median(took_ms[1:]))
"""


def export(commit: str, folder: Path) -> None:
    """The tree of a commit into a folder. Raises CalledProcessError where the history lacks it."""
    packed = subprocess.run(["git", "archive", commit], capture_output=True, check=True).stdout
    subprocess.run(["tar", "-x", "-C", str(folder)], input=packed, check=True)


def timed(tree: Path, pairs: Path) -> float:
    """Processor milliseconds a picture of the tree's default method."""
    environment = os.environ | {
        "OMP_NUM_THREADS": "1",
        "PYTHONPATH": f"{tree}:{tree}/clients/python",
    }
    run = [sys.executable, "-W", "ignore", "-c", _TIMED, str(pairs)]
    done = subprocess.run(
        run, cwd=tree, env=environment, capture_output=True, text=True, check=True
    )
    return float(done.stdout)


def measure(shared: Path, commit: str, rounds: int) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as name:
        before, pairs = Path(name) / "before", Path(name) / "pairs.npz"
        before.mkdir()
        export(commit, before)
        arrays = {}
        for k, photo in enumerate(photos(shared, "ewd")):
            arrays |= {f"mask{k}": photo.mask, f"image{k}": photo.image}
        np.savez(pairs, **arrays)
        took = np.array([[timed(t, pairs) for t in (before, Path.cwd())] for _ in range(rounds)])
    ratios = np.round(took[:, 1] / took[:, 0], 3)
    return {
        "commit": commit,
        "pictures": len(arrays) // 2,
        "before_ms": round(float(np.median(took[:, 0])), 2),
        "now_ms": round(float(np.median(took[:, 1])), 2),
        "ratios": ratios.tolist(),
        "ratio": round(float(np.median(ratios)), 3),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("shared", type=Path)
    parser.add_argument("--commit", default=FIRST_RELEASE)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    arguments = parser.parse_args()
    result = measure(arguments.shared, arguments.commit, arguments.rounds)
    print(json.dumps(result, indent=2))
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "before.json").write_text(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
