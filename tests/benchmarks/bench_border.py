"""Foreground outside of a picture, against the truth: how long along the edge it must be to stop
there.

    python -m tests.benchmarks.bench_border [--scenes 60]

Rendered masks are cropped, so that what is beyond the crop's edges is known: 12 windows of each
scene, in every other one an edge is put beside a cable that runs along it. Error: mean difference
of the distances to the background inside the crop, within 40 px of its edges, px. Prints a row for
each length (in depths), the one in use marked, and for no rule (foreground always goes on) and
background all around.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator

import numpy as np

from models.geometry.arrays import BoolArray, Float32Array
from models.strands import foreground
from models.synthesis.textures import load_pool
from models.training.instances.section_matching_scenes import TrainScene, make_scene

LENGTHS = (1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0)
SIZE = (200, 300)
NEAR_PX = 40


def windows(
    scene: TrainScene, rng: np.random.Generator, count: int = 12
) -> Iterator[tuple[BoolArray, Float32Array]]:
    """Crops of a scene's mask, ``(h, w)``, and the distances in them as the whole scene shows
    them."""
    distances = foreground.distance_map(scene.mask)
    for k in range(count):
        free = np.array(scene.mask.shape) - SIZE
        corner = rng.integers(0, free)
        if k % 2 and scene.curves:
            corner[0] = np.clip(_beside_a_cable(scene, rng), 0, free[0])
        rows, columns = (slice(c, c + size) for c, size in zip(corner.tolist(), SIZE, strict=True))
        yield scene.mask[rows, columns], distances[rows, columns]


def _beside_a_cable(scene: TrainScene, rng: np.random.Generator) -> int:
    """Row through, or within a width of, a place at which a cable runs from left to right."""
    k = int(rng.integers(len(scene.curves)))
    step = np.gradient(scene.curves[k], axis=0)
    level = np.flatnonzero(np.abs(step[:, 1]) < 0.1 * np.abs(step[:, 0]))
    place = int(rng.choice(level)) if len(level) else 0
    return round(float(scene.curves[k][place, 1] + rng.uniform(-1, 1) * scene.widths_px[k]))


def error(mask: BoolArray, true: Float32Array) -> tuple[float, int]:
    """Summed difference of the distances near the edge, and of how many pixels."""
    near = np.ones(mask.shape, bool)
    near[NEAR_PX:-NEAR_PX, NEAR_PX:-NEAR_PX] = False
    near &= mask
    off = np.abs(foreground.distance_map(mask) - true)[near]
    return float(off.sum()), int(near.sum())


def errors(lengths: tuple[float, ...], scenes: int, seed: int = 71) -> dict[float, float]:
    """Mean error for each length, px; of worn masks as networks give them."""
    rng, pool = np.random.default_rng(seed), load_pool(None)
    sums = dict.fromkeys(lengths, (0.0, 0))
    in_use = foreground.ALONG
    try:
        for _ in range(scenes):
            for mask, true in windows(make_scene(rng, pool, wear=0.5), rng):
                for length in lengths:
                    foreground.ALONG = length
                    total, pixels = error(mask, true)
                    sums[length] = sums[length][0] + total, sums[length][1] + pixels
    finally:
        foreground.ALONG = in_use
    return {length: total / max(pixels, 1) for length, (total, pixels) in sums.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=60)
    asked = parser.parse_args()
    for length, mean in errors((*LENGTHS, 1e9), asked.scenes).items():
        name = "no rule" if length == 1e9 else f"{length:g} depths"
        print(f"{name:>10}  {mean:.3f} px{'  in use' if length == foreground.ALONG else ''}")


if __name__ == "__main__":
    main()
