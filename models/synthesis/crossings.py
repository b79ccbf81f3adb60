"""Rendered pictures of one crossing each, for the networks of FASTDLO and Ariadne+."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.polylines import arc_lengths, point_at
from models.synthesis.cables import Cable, paint_cables
from models.synthesis.canvas import Canvas
from models.synthesis.curves import interpolate
from models.synthesis.looks import random_color, random_light, random_look
from models.synthesis.optics import photograph
from models.synthesis.scenes import to_uint8
from models.synthesis.textures import TexturePool, load_pool

SIDE = 160
_REACH_PX = 130.0
_LEAST_ANGLE = np.deg2rad(18.0)


@dataclass(frozen=True, eq=False)
class Strand:
    """One cable of the crossing: ``(n, 2)`` curve, arc lengths, width, and the arc length of the
    crossing."""

    xy: FloatArray
    lengths: FloatArray
    width_px: float
    middle: float

    def at(self, offset_px: float) -> FloatArray:
        """``(2,)`` the point so far along the curve from the crossing."""
        return point_at(self.xy, self.lengths, np.array(self.middle + offset_px))

    def outward(self, offset_px: float) -> FloatArray:
        """``(2,)`` unit tangent there, pointing away from the crossing."""
        step = self.at(offset_px * 1.0) - self.at(offset_px - np.sign(offset_px) * 4.0)
        out: FloatArray = step / max(float(np.hypot(*step)), 1e-9)
        return out


@dataclass(frozen=True, eq=False)
class RenderedCrossing:
    """``rgb``: ``(SIDE, SIDE, 3)``; ``ids``: who is seen, 0 background; ``top``: index of the upper
    strand."""

    rgb: ByteArray
    ids: ByteArray
    strands: tuple[Strand, ...]
    top: int


def render_crossing(rng: np.random.Generator, pool: TexturePool) -> RenderedCrossing:
    """Two or three cables that meet near the middle. In a third of the pictures they look the
    same."""
    count = 3 if rng.random() < 0.2 else 2
    typical = float(np.exp(rng.uniform(np.log(5.0), np.log(24.0))))
    alike = random_color(rng) if rng.random() < 0.35 else None
    canvas = Canvas(pool.sample(rng, (SIDE, SIDE), torch.device("cpu")).contiguous())
    light = random_light(rng)
    strands, cables = [], []
    for k, angle in enumerate(_angles(rng, count)):
        width = typical * float(np.exp(rng.normal(0.0, 0.2)))
        strand, curve = _strand(rng, angle, width)
        curve[:, 2] = (k + 1) / (count + 1)  # the last one is on top
        look = random_look(rng, alike or random_color(rng), width)
        cables.append(Cable(curve, np.full(len(curve), width / 2, np.float32), look))
        strands.append(strand)
    plan = paint_cables(canvas, cables, light, rng)
    owner = np.array([0, *(piece.cable + 1 for piece in plan.pieces)], np.uint8)
    rgb = to_uint8(photograph(canvas.rgb, rng))
    return RenderedCrossing(rgb, owner[canvas.ids.numpy()], tuple(strands), count - 1)


def _angles(rng: np.random.Generator, count: int) -> FloatArray:
    """Headings modulo a half turn, no two nearer than the least angle."""
    while True:
        angles = rng.uniform(0, np.pi, count)
        apart = np.diff(np.sort(np.append(angles, angles.min() + np.pi)))
        if apart.min() > _LEAST_ANGLE:
            out: FloatArray = angles + np.pi * rng.integers(0, 2, count)
            return out


def _strand(rng: np.random.Generator, angle: float, width: float) -> tuple[Strand, np.ndarray]:
    """A bent curve through about the middle of the picture, and the same as ``(m, 3)`` for the
    painter."""
    turning = rng.normal(0.0, 0.004) / max(1.0, width / 10)
    along = np.linspace(-_REACH_PX, _REACH_PX, 9)
    headings = angle + turning * along + 0.3 * turning * rng.normal(0, 20, len(along))
    steps = np.stack((np.cos(headings), np.sin(headings)), axis=1) * (along[1] - along[0])
    control = np.cumsum(steps, axis=0)
    control += SIDE / 2 + rng.normal(0, 0.25 * width, 2) - control[len(along) // 2]
    height = np.full((len(control), 1), 0.5)
    curve = interpolate(np.concatenate((control, height), axis=1).astype(np.float32), 0.7)
    xy = curve[:, :2].astype(np.float64)
    lengths = arc_lengths(xy)
    nearest = int(np.argmin(np.hypot(*(xy - SIDE / 2).T)))
    return Strand(xy, lengths, width, float(lengths[nearest])), curve


def write_crossings(path: Path, count: int, seed: int, pool: TexturePool) -> None:
    """``count`` crossings as pictures and curves in one ``.npz``: rendered once, read by every
    training."""
    torch.set_num_threads(1)
    scenes = [render_crossing(np.random.default_rng([seed, k]), pool) for k in range(count)]
    owners = np.repeat(np.arange(count), [len(s.strands) for s in scenes])
    strands = [s for scene in scenes for s in scene.strands]
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(
        path,
        rgb=np.stack([s.rgb for s in scenes]),
        ids=np.stack([s.ids for s in scenes]),
        owners=owners,
        widths=np.array([s.width_px for s in strands]),
        middles=np.array([s.middle for s in strands]),
        points=np.array([len(s.xy) for s in strands]),
        xy=np.concatenate([s.xy for s in strands]),
    )


def crossings_kept(
    folder: Path, count: int, seed: int, textures: Path | None
) -> list[RenderedCrossing]:
    """The crossings that all trainings share, rendered into ``folder`` by the first that needs
    them."""
    pack = folder / f"crossings_{count}.npz"
    if not pack.exists():
        write_crossings(pack, count, seed, load_pool(textures))
    return read_crossings(pack)


def read_crossings(path: Path) -> list[RenderedCrossing]:
    """What :func:`write_crossings` wrote."""
    with np.load(path) as pack:
        rgb, ids, owners = pack["rgb"], pack["ids"], pack["owners"]
        curves = np.split(pack["xy"], np.cumsum(pack["points"])[:-1])
        strands: list[list[Strand]] = [[] for _ in rgb]
        for owner, xy, width, middle in zip(
            owners, curves, pack["widths"], pack["middles"], strict=True
        ):
            strands[owner].append(Strand(xy, arc_lengths(xy), float(width), float(middle)))
    return [
        RenderedCrossing(p, i, tuple(s), len(s) - 1)
        for p, i, s in zip(rgb, ids, strands, strict=True)
    ]


def crop(rgb: ByteArray, center_xy: FloatArray, side: int, pixels: int) -> ByteArray:
    """``(pixels, pixels, 3)``: the square of ``side`` picture pixels around the center, 0
    outside."""
    scale = pixels / side
    shift = pixels / 2 - 0.5 - scale * center_xy
    matrix = np.array([[scale, 0, shift[0]], [0, scale, shift[1]]])
    flags = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return np.asarray(cv2.warpAffine(rgb, matrix, (pixels, pixels), flags=flags), dtype=np.uint8)
