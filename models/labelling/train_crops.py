"""Crops with a known offset, cut from rendered scenes: what the corrector learns from and is tested on.

    python -m models.labelling.train_crops build/crops --textures TEXTURES.npz

Every crop is taken at a point of a DLO that is seen there, moved across it by a fictitious error of the hand and
of the calibration. Scene k is always the same picture (seed, k); writing goes on where it was cut off.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial import cKDTree

from models.geometry.arrays import ByteArray, Float32Array, FloatArray
from models.labelling.crops import MIDDLE, SIZE, in_crop, pixels_per_crop_pixel, upright_crops
from models.synthesis.scenes import Labelled, SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool

HELD_OUT_SEED = 10**6


@dataclass(frozen=True)
class CropParams:
    """``error_px`` the largest offset and ``tilt_rad`` the spread of the direction's error; ``per_scene`` crops of
    one scene, ``clear_px`` how far from the picture's border they stay."""

    seed: int = 1
    scenes: int = 2000
    per_scene: int = 20
    height: int = 320
    width: int = 448
    error_px: float = 16.0
    tilt_rad: float = 0.12
    clear_px: float = 8.0

    def scene(self) -> SceneParams:
        return SceneParams((self.height, self.width), width_share=(0.012, 0.07), empty_share=0.0)


class Crops(NamedTuple):
    """(n, SIZE, SIZE, 3) crops; (n,) column of the centerline on the middle row; (n,) width in pixels of the crop;
    (n,) by how much, in pixels of the crop, the DLO that is meant is nearer to the crop's middle than any other: below
    0 nothing in the crop says which one is meant."""

    images: ByteArray
    columns: Float32Array
    widths: Float32Array
    margins: Float32Array


class Pick(NamedTuple):
    """A sample of a DLO's centerline: DLO, its sample."""

    cable: int
    sample: int


def crops_of(scene: Labelled, rng: np.random.Generator, params: CropParams) -> Crops:
    """Up to ``params.per_scene`` crops of one scene; fewer where little of its DLOs is seen."""
    image = to_uint8(scene.rgb)
    lines = [np.asarray(line[:, :2], np.float64) for line in scene.centerlines]
    trees = [cKDTree(line) for line in lines]
    picks = _seen(scene, lines, params)
    images, columns, widths, margins = [], [], [], []
    for pick in (picks[i] for i in rng.permutation(len(picks))[: params.per_scene]):
        width = float(scene.widths_px[pick.cable])
        at, tangent, scale = _disturbed(lines[pick.cable], pick.sample, width, rng, params)
        column = _column(lines[pick.cable], pick.sample, at, tangent, scale)
        if column is None:
            continue
        images.append(upright_crops(image, at[None], tangent[None], np.array([scale]))[0])
        columns.append(column)
        widths.append(width / scale)
        away = [float(tree.query(at)[0]) for tree in trees]
        others = away[: pick.cable] + away[pick.cable + 1 :]
        margins.append((min(others, default=1e3) - away[pick.cable]) / scale)
    return Crops(
        np.asarray(images, np.uint8).reshape(-1, SIZE, SIZE, 3),
        np.asarray(columns, np.float32),
        np.asarray(widths, np.float32),
        np.asarray(margins, np.float32),
    )


def _seen(scene: Labelled, lines: list[FloatArray], params: CropParams) -> list[Pick]:
    """Every eighth sample that lies in the picture with its own DLO on top."""
    ids = scene.ids.cpu().numpy()
    height, width = ids.shape
    low, high = params.clear_px, np.array([width, height]) - 1 - params.clear_px
    picks = []
    for cable, line in enumerate(lines):
        for sample in range(4, len(line) - 4, 8):
            x, y = line[sample]
            inside = low <= x <= high[0] and low <= y <= high[1]
            if inside and ids[round(y), round(x)] == cable + 1:
                picks.append(Pick(cable, sample))
    return picks


def _disturbed(
    line: FloatArray, sample: int, width: float, rng: np.random.Generator, params: CropParams
) -> tuple[FloatArray, FloatArray, float]:
    """Where a hand might have marked the sample: point, tangent, scale of the crop."""
    believed = width * np.exp(rng.normal(0, 0.15))
    scale = float(pixels_per_crop_pixel(np.array([believed]))[0])
    tangent = line[min(sample + 4, len(line) - 1)] - line[max(sample - 4, 0)]
    angle = np.arctan2(tangent[1], tangent[0]) + rng.normal(0, params.tilt_rad) + rng.integers(2) * np.pi
    tangent = np.array([np.cos(angle), np.sin(angle)])
    normal = np.array([-tangent[1], tangent[0]])
    return line[sample] + normal * rng.uniform(-1, 1) * params.error_px * scale, tangent, scale


def _column(line: FloatArray, sample: int, at: FloatArray, tangent: FloatArray, scale: float) -> float | None:
    """Where the centerline, followed from the sample both ways, first crosses the crop's middle row."""
    local = in_crop(line, at, tangent, scale)
    below = local[:, 1] - MIDDLE
    change = np.flatnonzero((below[:-1] <= 0) != (below[1:] <= 0))
    if not len(change):
        return None
    k = int(change[np.argmin(np.abs(change - sample))])
    share = below[k] / (below[k] - below[k + 1])
    column = float(local[k, 0] + share * (local[k + 1, 0] - local[k, 0]))
    return column if 4 <= column <= SIZE - 5 else None


def contrast(crops: Crops) -> FloatArray:
    """(n,) by how much the DLO stands out where it is marked: the mean difference, 0 to 255, of its color to that of
    the ground beside it on the side where it differs more."""
    out = np.zeros(len(crops.images))
    for k, (image, column, width) in enumerate(zip(crops.images, crops.columns, crops.widths, strict=True)):
        band = image[SIZE // 2 - 3 : SIZE // 2 + 3].mean(0)
        half = float(width) / 2
        own = band[_columns(column - 0.6 * half, column + 0.6 * half)].mean(0)
        sides = [_columns(column - half - 6, column - half - 1), _columns(column + half + 1, column + half + 6)]
        out[k] = max(
            (float(np.abs(band[side].mean(0) - own).mean()) for side in sides if side.stop > side.start), default=0
        )
    return out


def _columns(first: float, last: float) -> slice:
    return slice(max(round(first), 0), max(min(round(last) + 1, SIZE), 0))


def write(folder: Path, params: CropParams, pool: TexturePool) -> None:
    """One file of crops for every 50 scenes, whole or not at all; those that are there are left alone."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "params.json").write_text(json.dumps(asdict(params)))
    for first in range(0, params.scenes, 50):
        file = folder / f"{first:06d}.npz"
        if file.exists():
            continue
        parts = []
        for k in range(first, min(first + 50, params.scenes)):
            rng = np.random.default_rng([params.seed, k])
            parts.append(crops_of(render_scene(rng, params.scene(), pool), rng, params))
        partial = file.with_suffix(".part")
        with partial.open("wb") as out:
            whole = {name: np.concatenate([getattr(p, name) for p in parts]) for name in Crops._fields}
            np.savez(out, **whole)  # type: ignore[arg-type]
        partial.replace(file)
        print(f"{file.name}: {sum(len(p.images) for p in parts)} crops", flush=True)


def read(folder: Path, at_most: int | None = None) -> Crops:
    """All crops written so far."""
    files = sorted(folder.glob("*.npz"))[:at_most]
    if not files:
        raise FileNotFoundError(f"no crops in {folder}")
    packs = [np.load(file) for file in files]
    return Crops(*(np.concatenate([pack[name] for pack in packs]) for name in Crops._fields))


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.labelling.train_crops",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("--textures", type=Path)
    for name, default in asdict(CropParams()).items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(default), default=default)
    args = parser.parse_args()
    torch.set_num_threads(1)
    params = CropParams(**{name: getattr(args, name) for name in asdict(CropParams())})
    write(args.folder, params, load_pool(args.textures))


if __name__ == "__main__":
    main()
