"""Pictures of the empty place: what they are worth on hard grounds, in new light, under an arm's
shadow.

    python -m tests.benchmarks.bench_reference [--cells N] [--places K] [--seed S]

Rendered cells (``models.synthesis.cells``) of the industrial, busy and workshop styles over the
grounds that ship with the training: Dice at the network's threshold without and with the reference,
mean over the cells; ``hard`` are the cells where the network alone stays below 80 %. Also how many
were refused as another place, and a picture of a different place as reference, which has to change
nothing. Writes ``build/bench/reference.json``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from models.segmentation.empty_place import weigh
from models.segmentation.segment import ForegroundInput, segment
from models.synthesis.cells import Cell, render_cell
from models.synthesis.scenes import SceneParams
from models.synthesis.textures import load_pool
from models.training.foreground.adaptation.sources import GROUNDS
from models.training.foreground.empty_place import STYLES
from models.weights.inference import Runtime, default_name, load
from tests.benchmarks.bench_foreground import score

OUT = Path("build/bench/reference.json")

_HARD = 0.8
_REPORTED_SEED = 50_000_001


def cells(count: int, places: int, seed: int) -> Iterator[Cell]:
    pool = load_pool(GROUNDS)
    for k in range(count):
        params = SceneParams((360, 640), width_share=(0.008, 0.06), style=STYLES[k % len(STYLES)])
        yield render_cell(np.random.default_rng([seed, k]), params, pool, places)


def measure(count: int, places: int, seed: int) -> list[dict[str, float]]:
    network = load(default_name("foreground"), Runtime(threads=1))
    settings = ForegroundInput.from_manifest(network.spec.preprocess)
    rows = []
    other: Cell | None = None
    for cell in cells(count, places, seed):
        alone = segment(cell.picture, network, settings)
        weighed = weigh(cell.picture, alone, cell.places)
        wrong = weigh(cell.picture, alone, other.places[:1]) if other else None
        other = cell
        rows.append(
            {
                "alone": _dice(alone, cell, settings.threshold),
                "with": _dice(weighed.probability, cell, settings.threshold),
                "used": float(weighed.reason is None),
                "relied": weighed.relied,
                "wrong_used": float(wrong is not None and wrong.reason is None),
            }
        )
    return rows


def _dice(probability: np.ndarray, cell: Cell, threshold: float) -> float:
    return float(score(probability >= threshold, cell.mask)["dice"])


def summary(rows: list[dict[str, float]]) -> dict[str, float]:
    def mean(key: str, of: list[dict[str, float]]) -> float:
        return float(np.mean([row[key] for row in of])) if of else float("nan")

    hard = [row for row in rows if row["alone"] < _HARD]
    return {
        "cells": len(rows),
        "alone": round(100 * mean("alone", rows), 2),
        "with": round(100 * mean("with", rows), 2),
        "hard_cells": len(hard),
        "hard_alone": round(100 * mean("alone", hard), 2),
        "hard_with": round(100 * mean("with", hard), 2),
        "worse_by_two": int(sum(row["with"] < row["alone"] - 0.02 for row in rows)),
        "used_percent": round(100 * mean("used", rows), 1),
        "other_place_used_percent": round(100 * mean("wrong_used", rows[1:]), 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cells", type=int, default=90)
    parser.add_argument("--places", type=int, default=1)
    parser.add_argument("--seed", type=int, default=_REPORTED_SEED)
    args = parser.parse_args()
    result = summary(measure(args.cells, args.places, args.seed))
    OUT.parent.mkdir(parents=True, exist_ok=True)
    OUT.write_text(json.dumps(result, indent=1))
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
