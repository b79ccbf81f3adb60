"""The plane on which things lie.

Strategy: a plane through three random places is right if many others are within the sensor's noise
of it (RANSAC); the best is fitted again to the places near it, with what is further off counting
less, until nothing changes. Things on the table, holes and flying pixels have no say.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray
from models.geometry.cameras import Camera

_SAMPLES, _TRIALS, _ROUNDS = 4000, 256, 8
_NEAR_M, _NEAR_SHARE = 0.002, 0.004
"""Within so much, and so much of the distance, a place is on a plane while noise is not known."""
_LEAST_SHARE = 0.2
"""Of the places that are known has to be on the table."""
_LEAST_PLACES = 50
_TUKEY = 4.7
_STEEPEST = 0.1
"""Cosine between the plane's normal and the view: seen nearly along itself, it is no table."""
_LEAST_SIGMA_M = 1e-5


@dataclass(frozen=True, eq=False)
class Table:
    """Points x of it satisfy ``normal · x = offset_m``, in the frame of ``Camera.T_world_camera``;
    ``normal`` (3,) is of unit length, towards the camera. ``sigma_m``: standard deviation of the
    depth's noise across it; ``share`` of the known places that are on it."""

    normal: FloatArray
    offset_m: float
    sigma_m: float
    share: float


def known(depth_m: Float32Array) -> np.ndarray:
    """(H, W) where there is a depth."""
    return np.asarray(np.isfinite(depth_m) & (depth_m > 0))


def find_table(depth_m: Float32Array, camera: Camera, rng: np.random.Generator) -> Table | None:
    """The table of a depth map; None if too little of it is one plane."""
    points = _points(depth_m, camera, rng)
    if len(points) < _LEAST_PLACES:
        return None
    near = _NEAR_M + _NEAR_SHARE * float(np.median(np.linalg.norm(points - camera.center, axis=1)))
    plane = _best_of_trials(points, near, rng)
    if plane is None:
        return None
    normal, offset, sigma = _refined(points, plane, near)
    if normal @ camera.center < offset:
        normal, offset = -normal, -offset
    share = float((np.abs(points @ normal - offset) < 3 * sigma).mean())
    seen_from = abs(float(normal @ camera.rotation[:, 2]))
    if share < _LEAST_SHARE or seen_from < _STEEPEST:
        return None
    return Table(normal, float(offset), max(sigma, _LEAST_SIGMA_M), share)


def heights(depth_m: Float32Array, camera: Camera, table: Table) -> Float32Array:
    """(H, W) meters above the table; NaN where the depth is unknown."""
    height, width = depth_m.shape
    columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    pixels = camera.undistort(np.column_stack([columns.ravel(), rows.ravel()]))
    along = (camera.rays(pixels) @ table.normal).reshape(height, width)
    above = along * np.where(known(depth_m), depth_m, np.nan) + (
        table.normal @ camera.center - table.offset_m
    )
    return np.asarray(above, np.float32)


def _points(depth_m: Float32Array, camera: Camera, rng: np.random.Generator) -> FloatArray:
    """(n, 3) known places, at most ``_SAMPLES``."""
    rows, columns = np.nonzero(known(depth_m))
    if len(rows) > _SAMPLES:
        chosen = rng.choice(len(rows), _SAMPLES, replace=False)
        rows, columns = rows[chosen], columns[chosen]
    rays = camera.rays(camera.undistort(np.column_stack([columns, rows]).astype(float)))
    points = camera.center + rays * depth_m[rows, columns, None].astype(float)
    return np.asarray(points[np.isfinite(points).all(1)])


def _best_of_trials(
    points: FloatArray, near: float, rng: np.random.Generator
) -> tuple[FloatArray, float] | None:
    a, b, c = points[rng.integers(0, len(points), (3, _TRIALS))]
    normals = np.cross(b - a, c - a)
    sizes = np.linalg.norm(normals, axis=1)
    a, normals, sizes = a[sizes > 1e-12], normals[sizes > 1e-12], sizes[sizes > 1e-12]
    if not len(normals):
        return None
    normals = normals / sizes[:, None]
    offsets = (normals * a).sum(1)
    on_it = (np.abs(points @ normals.T - offsets) < near).sum(0)
    best = int(on_it.argmax())
    return normals[best], float(offsets[best])


def _refined(
    points: FloatArray, plane: tuple[FloatArray, float], near: float
) -> tuple[FloatArray, float, float]:
    """Normal, offset and noise, by least squares with Tukey's weights."""
    (normal, offset), sigma = plane, near / 2
    for _ in range(_ROUNDS):
        off = points @ normal - offset
        weights = np.clip(1 - (off / (_TUKEY * sigma)) ** 2, 0, None) ** 2
        if weights.sum() < 3:
            break
        middle = np.average(points, axis=0, weights=weights)
        spread = (points - middle) * np.sqrt(weights)[:, None]
        normal = np.linalg.eigh(spread.T @ spread)[1][:, 0]
        offset = float(normal @ middle)
        off = np.abs(points @ normal - offset)
        near_it = off[off < 3 * sigma]
        sigma = (
            float(np.clip(1.4826 * np.median(near_it), _LEAST_SIGMA_M, near))
            if len(near_it)
            else sigma
        )
    return normal, offset, sigma
