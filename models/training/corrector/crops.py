"""Crops with a known offset, cut from rendered scenes: what the corrector learns from and is tested
on.

    python -m models.training.corrector.crops build/crops --textures TEXTURES.npz

Every crop is taken at a point of a DLO that is seen there, moved across it by a fictitious error of
the hand and of the calibration. Scene k is always the same picture (seed, k); writing goes on where
it was cut off.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from models.geometry.arrays import ByteArray, Float32Array, FloatArray, IntArray
from models.synthesis.scenes import Labelled, SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool
from models.tracked_labels.crops import MIDDLE, SIZE, in_crop, pixels_per_crop_pixel, upright_crops


@dataclass(frozen=True)
class CropParams:
    """``thinnest_px`` to ``thickest_px`` the DLOs' widths, ``clutter`` how often other things lie
    about; ``error_px`` the largest offset and ``tilt_rad`` the spread of the direction's error;
    ``per_scene`` crops of one scene, ``clear_px`` how far from the picture's border they stay."""

    seed: int = 1
    scenes: int = 2000
    per_scene: int = 20
    height: int = 320
    width: int = 448
    thinnest_px: float = 5.0
    thickest_px: float = 31.0
    clutter: float = 0.8
    error_px: float = 16.0
    tilt_rad: float = 0.12
    clear_px: float = 8.0

    def scene(self) -> SceneParams:
        bounds = (self.thinnest_px / self.width, self.thickest_px / self.width)
        return SceneParams(
            (self.height, self.width), width_share=bounds, empty_share=0.0, clutter=self.clutter
        )


@dataclass(frozen=True, eq=False)
class Crops:
    """(n, SIZE, SIZE, 3) crops; (n,) column of the centerline on the middle row; (n,) width in
    pixels of the crop; (n,) by how much, in pixels of the crop, the DLO that is meant is nearer to
    the crop's middle than any other, or than itself where it comes back: below 0 nothing in the
    crop shows which one is meant."""

    images: ByteArray
    columns: Float32Array
    widths: Float32Array
    margins: Float32Array

    def __len__(self) -> int:
        return len(self.columns)

    def take(self, rows: IntArray | slice) -> Crops:
        """Those of the given numbers."""
        return Crops(self.images[rows], self.columns[rows], self.widths[rows], self.margins[rows])


def joined(parts: Sequence[Crops]) -> Crops:
    """All of them as one."""
    return Crops(
        np.concatenate([part.images for part in parts]),
        np.concatenate([part.columns for part in parts]),
        np.concatenate([part.widths for part in parts]),
        np.concatenate([part.margins for part in parts]),
    )


class Pick(NamedTuple):
    """A sample of a DLO's centerline: DLO, its sample."""

    cable: int
    sample: int


def crops_of(scene: Labelled, rng: np.random.Generator, params: CropParams) -> Crops:
    """Up to ``params.per_scene`` crops of one scene; fewer where little of its DLOs is seen."""
    image, ids = to_uint8(scene.rgb), scene.ids.cpu().numpy()
    lines = [np.asarray(line[:, :2], np.float64) for line in scene.centerlines]
    picks = _seen(ids, lines, params)
    images, columns, widths, margins = [], [], [], []
    for pick in (picks[i] for i in rng.permutation(len(picks))[: params.per_scene]):
        width = float(scene.widths_px[pick.cable])
        at, tangent, scale = _disturbed(lines[pick.cable], pick.sample, width, rng, params)
        column = _column(ids, lines, pick, at, tangent, scale)
        if column is None:
            continue
        images.append(upright_crops(image, at[None], tangent[None], np.array([scale]))[0])
        columns.append(column)
        widths.append(width / scale)
        margins.append(_margin(lines, pick, at) / scale)
    return Crops(
        np.asarray(images, np.uint8).reshape(-1, SIZE, SIZE, 3),
        np.asarray(columns, np.float32),
        np.asarray(widths, np.float32),
        np.asarray(margins, np.float32),
    )


def _seen(ids: NDArray[np.int16], lines: list[FloatArray], params: CropParams) -> list[Pick]:
    """Every eighth sample that lies in the picture with its own DLO on top."""
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
    angle = (
        np.arctan2(tangent[1], tangent[0])
        + rng.normal(0, params.tilt_rad)
        + rng.integers(2) * np.pi
    )
    tangent = np.array([np.cos(angle), np.sin(angle)])
    normal = np.array([-tangent[1], tangent[0]])
    return line[sample] + normal * rng.uniform(-1, 1) * params.error_px * scale, tangent, scale


def _column(
    ids: NDArray[np.int16],
    lines: list[FloatArray],
    pick: Pick,
    at: FloatArray,
    tangent: FloatArray,
    scale: float,
) -> float | None:
    """Where the centerline, followed from the sample both ways, first crosses the crop's middle
    row; None where it is covered there."""
    line = lines[pick.cable]
    local = in_crop(line, at, tangent, scale)
    below = local[:, 1] - MIDDLE
    change = np.flatnonzero((below[:-1] <= 0) != (below[1:] <= 0))
    if not len(change):
        return None
    k = int(change[np.argmin(np.abs(change - pick.sample))])
    share = below[k] / (below[k] - below[k + 1])
    column = float(local[k, 0] + share * (local[k + 1, 0] - local[k, 0]))
    x, y = np.rint(line[k]).astype(int)
    inside = 0 <= y < ids.shape[0] and 0 <= x < ids.shape[1]
    return column if inside and ids[y, x] == pick.cable + 1 and 4 <= column <= SIZE - 5 else None


def _margin(lines: list[FloatArray], pick: Pick, at: FloatArray) -> float:
    """By how much, px, the DLO near the sample is nearer to ``at`` than all others and its own
    farther parts."""
    own = lines[pick.cable]
    along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(own, axis=0).T))))
    here = np.abs(along - along[pick.sample]) <= SIZE / 2
    away = np.hypot(*(own - at).T)
    others = [
        float(np.hypot(*(line - at).T).min()) for k, line in enumerate(lines) if k != pick.cable
    ]
    return min([*others, *away[~here].tolist()], default=1e3) - float(away[here].min())


def contrast(crops: Crops) -> FloatArray:
    """(n,) by how much the DLO stands out where it is marked: the mean difference, 0 to 255, of its
    color to that of the ground beside it on the side where it differs more."""
    out = np.zeros(len(crops.images))
    for k, (image, column, width) in enumerate(
        zip(crops.images, crops.columns, crops.widths, strict=True)
    ):
        band = image[SIZE // 2 - 3 : SIZE // 2 + 3].mean(0)
        half = float(width) / 2
        own = band[_columns(column - 0.6 * half, column + 0.6 * half)].mean(0)
        sides = [
            _columns(column - half - 6, column - half - 1),
            _columns(column + half + 1, column + half + 6),
        ]
        out[k] = max(
            (
                float(np.abs(band[side].mean(0) - own).mean())
                for side in sides
                if side.stop > side.start
            ),
            default=0,
        )
    return out


def _columns(first: float, last: float) -> slice:
    return slice(max(round(first), 0), max(min(round(last) + 1, SIZE), 0))


def write(folder: Path, params: CropParams, pool: TexturePool) -> None:
    """One file of crops for every 50 scenes, whole or not at all; those that are there are left
    alone."""
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
            np.savez(out, **vars(joined(parts)))
        partial.replace(file)
        print(f"{file.name}: {sum(len(p.images) for p in parts)} crops", flush=True)


def read(folder: Path, at_most: int | None = None) -> Crops:
    """All crops written so far."""
    files = sorted(folder.glob("*.npz"))[:at_most]
    if not files:
        raise FileNotFoundError(f"no crops in {folder}")
    packs = [np.load(file) for file in files]
    return joined([Crops(*(pack[name] for name in Crops.__dataclass_fields__)) for pack in packs])


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.corrector.crops",
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
