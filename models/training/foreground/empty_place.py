"""The weights of ``models.segmentation.empty_place``, fitted on rendered cells: ``python -m`` this
module prints them.

Logistic regression of cable or not, the network's log odds given: what the pictures of the empty
place add to them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from models.geometry.arrays import Float32Array, FloatArray
from models.segmentation.empty_place import MAYBE_CABLE, Weights, align, change, evidence, log_odds
from models.segmentation.segment import ForegroundInput, segment
from models.synthesis.cells import render_cell
from models.synthesis.clutter import Style
from models.synthesis.scenes import SceneParams
from models.synthesis.textures import load_pool
from models.training.foreground.adaptation.sources import GROUNDS
from models.weights.inference import Runtime, default_name, load

STYLES: tuple[Style, ...] = ("industrial", "busy", "workshop")
_PIXELS = 4000
"""Of a cell."""
_SMALL = 1e-4
"""Weight of the sum of squares, against weights that grow without need."""


def rows(
    count: int, seed: int, textures: Path
) -> Iterator[tuple[Float32Array, Float32Array, np.ndarray]]:
    """Per cell: evidence (n, 5), the network's log odds (n,), and whether it is cable (n,)."""
    network, pool = load(default_name("foreground"), Runtime(threads=1)), load_pool(textures)
    settings = ForegroundInput.from_manifest(network.spec.preprocess)
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        params = SceneParams((360, 640), width_share=(0.008, 0.06), style=STYLES[k % len(STYLES)])
        cell = render_cell(rng, params, pool)
        odds = log_odds(segment(cell.picture, network, settings))
        free = odds < np.log(MAYBE_CABLE / (1 - MAYBE_CABLE))
        over = align(cell.places[0], cell.picture, free)
        if isinstance(over, str):
            continue
        changed = change(cell.picture, over.place, over.valid, free)
        some = rng.choice(np.flatnonzero(over.valid.ravel()), _PIXELS)
        yield (
            evidence(changed.ravel()[some], odds.ravel()[some]),
            odds.ravel()[some],
            cell.mask.ravel()[some],
        )


def fit(evidences: FloatArray, odds: FloatArray, cable: np.ndarray) -> Weights:
    """The weights under which what is seen is most likely."""

    def cost(weights: FloatArray) -> tuple[float, FloatArray]:
        total = odds + evidences @ weights
        error = 1 / (1 + np.exp(-total)) - cable
        value = np.mean(np.logaddexp(0, total) - cable * total) + _SMALL * float(weights @ weights)
        return float(value), evidences.T @ error / len(cable) + 2 * _SMALL * weights

    found = minimize(cost, np.zeros(evidences.shape[1]), jac=True, method="L-BFGS-B")
    return Weights(*(round(float(w), 2) for w in found.x))


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.empty_place", description=__doc__
    )
    parser.add_argument("--cells", type=int, default=60)
    parser.add_argument("--seed", type=int, default=41)
    parser.add_argument(
        "--textures", type=Path, default=GROUNDS, help="pack or folder of backgrounds"
    )
    args = parser.parse_args(arguments)
    parts = [
        np.concatenate(part)
        for part in zip(*rows(args.cells, args.seed, args.textures), strict=True)
    ]
    print(fit(parts[0].astype(float), parts[1].astype(float), parts[2].astype(float)))


if __name__ == "__main__":
    main()
