"""Views of known curves: exact centerlines with noise, for cameras over a table."""

from __future__ import annotations

import numpy as np

from models.geometry.cameras import Camera, Intrinsics
from models.reconstruction.views import Strand, View

INTRINSICS = Intrinsics(640, 480, 600.0, 600.0, 319.5, 239.5)
DOWN = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])


def above(x: float, y: float = 0.0, z: float = 0.25, turn: np.ndarray | None = None) -> Camera:
    """Looks down from (x, y, z); ``turn`` (3, 3) is applied in the camera's own frame."""
    pose = np.eye(4)
    pose[:3, :3] = DOWN @ (np.eye(3) if turn is None else turn)
    pose[:3, 3] = x, y, z
    return Camera(INTRINSICS, pose)


def about(axis: int, angle: float) -> np.ndarray:
    """(3, 3) rotation about a coordinate axis."""
    cos, sin = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    out = np.eye(3)
    out[i, i] = out[j, j] = cos
    out[i, j], out[j, i] = -sin, sin
    return out


def arc(
    length: float = 0.2, bend: float = 3.0, rise: float = 0.02, count: int = 2000
) -> np.ndarray:
    """(n, 3) along y, swinging in x and rising in z."""
    s = np.linspace(-0.5, 0.5, count)
    heading = 0.15 * bend * np.sin(2 * np.pi * s)
    xy = np.cumsum(np.stack([np.sin(heading), np.cos(heading)], axis=1), axis=0) * length / count
    xy -= (xy.min(axis=0) + xy.max(axis=0)) / 2
    return np.concatenate([xy, (rise * (0.5 + 0.5 * np.sin(5 * s)))[:, None]], axis=1)


def strand(
    curve: np.ndarray, camera: Camera, rng: np.random.Generator | None = None, noise: float = 0.0
) -> Strand:
    """As the instance methods give it: a point about every 5 px, with noise; the width of a DLO of
    5 mm."""
    xy = camera.project(curve)
    xy = xy[np.isfinite(xy).all(axis=1)]
    xy = xy[camera.sees(xy)]
    length = np.hypot(*np.diff(xy, axis=0).T).sum()
    thin = xy[:: max(1, int(len(xy) * 5 / length))]
    if rng is not None:
        thin = thin + rng.normal(0, noise, thin.shape)
    depth = camera.in_camera(curve)[:, 2].mean()
    return Strand.through(thin, 0.005 * 600 / depth)


def views_of(
    curves: list[np.ndarray], cameras: list[Camera], seed: int | None = None, noise: float = 0.0
) -> list[View]:
    rng = None if seed is None else np.random.default_rng(seed)
    return [
        View(camera, tuple(strand(c, camera, rng, noise) for c in curves), f"view {k}")
        for k, camera in enumerate(cameras)
    ]
