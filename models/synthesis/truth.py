"""What is true of a rendered picture besides its pixels: crossings with their order, visibility,
camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.synthesis.curves import FloatArray
from models.synthesis.stacking import Stack

_SEAM = 4  # this many samples around a cut may lie under the neighboring piece of the same cable


@dataclass(frozen=True)
class Crossing:
    """At ``xy`` (px) cable ``over`` lies on cable ``under`` (1, 2, …; equal for a self-crossing);
    ``over_sample`` and ``under_sample`` index their centerlines. ``visible``: nothing else lies on
    top."""

    xy: tuple[float, float]
    over: int
    under: int
    over_sample: int
    under_sample: int
    visible: bool


@dataclass(frozen=True)
class Camera:
    """A pinhole: ``K`` (3, 3) px and ``T_camera_world`` (4, 4) m; the world is the table, z towards
    the camera.

    ``parallax``: whether heights above the table move points in the picture. The 2.5-D compositor
    draws the table as this camera, looking straight down, sees it, but everything on it without
    parallax: there the camera is exact for points of the table only."""

    K: FloatArray
    T_camera_world: FloatArray
    parallax: bool

    def project(self, world: FloatArray) -> FloatArray:
        """(n, 3) m to (n, 2) px."""
        homogeneous = np.concatenate([world, np.ones((len(world), 1), np.float32)], 1)
        image = (homogeneous @ self.T_camera_world[:3].T) @ self.K.T
        return np.asarray(image[:, :2] / image[:, 2:], np.float32)


def random_camera(
    rng: np.random.Generator, size: tuple[int, int], *, tilt_rad: float = 0.0
) -> Camera:
    """Focal length 0.8 to 1.5 picture widths, 0.25 to 0.9 m from the point of the table in the
    picture's middle, seen from ``tilt_rad`` beside straight above. Without tilt there is no
    parallax (the compositor)."""
    focal, distance = rng.uniform(0.8, 1.5) * size[1], rng.uniform(0.25, 0.9)
    K = np.array(
        [[focal, 0, (size[1] - 1) / 2], [0, focal, (size[0] - 1) / 2], [0, 0, 1]], np.float32
    )
    spin = rng.uniform(-np.pi, np.pi) if tilt_rad else 0.0
    cos, sin, c, s = np.cos(spin), np.sin(spin), np.cos(tilt_rad), np.sin(tilt_rad)
    turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
    lean = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    T = np.eye(4, dtype=np.float32)
    T[:3, :3] = turn @ lean @ turn.T @ np.diag([1.0, -1.0, -1.0])
    T[2, 3] = distance
    return Camera(K, T, parallax=tilt_rad != 0.0)


def crossings(plan: Stack, ids: NDArray[np.integer]) -> tuple[Crossing, ...]:
    """Those inside the picture. ``ids`` (H, W) holds k + 1 where piece k of ``plan`` is on top."""
    height, width = ids.shape
    found = []
    for meeting in plan.meetings:
        x, y = round(meeting.xy[0]), round(meeting.xy[1])
        if 0 <= x < width and 0 <= y < height:
            over, under = plan.over_and_under(meeting)
            seen = bool(ids[y, x] == plan.rank(*over) + 1)
            found.append(Crossing(meeting.xy, over[0] + 1, under[0] + 1, over[1], under[1], seen))
    return tuple(found)


def visible(
    plan: Stack, curve: FloatArray, cable: int, ids: NDArray[np.integer]
) -> NDArray[np.bool_]:
    """(m,) whether each sample of curve number ``cable`` lies in the picture and on top there."""
    height, width = ids.shape
    xy = np.rint(curve[:, :2]).astype(int)
    inside = np.logical_and(xy >= 0, xy < (width, height)).all(axis=1)
    top = np.zeros(len(curve), int)
    top[inside] = ids[xy[inside, 1], xy[inside, 0]]
    own, near_cut = np.zeros(len(curve), int), np.zeros(len(curve), bool)
    for k, piece in enumerate(plan.pieces):
        if piece.cable == cable:
            own[piece.start : piece.stop] = k + 1
            near_cut[max(piece.start - _SEAM, 0) : piece.start + _SEAM] = piece.start > 0
    cable_on_top = np.array([-1, *(p.cable for p in plan.pieces)])[top]
    return inside & ((top == own) | (near_cut & (cable_on_top == cable)))
