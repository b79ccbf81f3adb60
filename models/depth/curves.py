"""Centerlines in meters from the depth along them, with what is known about their errors.

Strategy: the depth is read in the middle of the strand, across it and along it; what another strand
covers, what flies and what is missing is left out. A parabola fitted around every point, nearer
samples counting more, gives the surface and how sure it is; half the thickness further along the
ray is the centerline.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, Float32Array, FloatArray
from models.geometry.cameras import Camera
from models.geometry.polylines import arc_lengths, point_at, resample
from models.geometry.sampling import read_nearest

_LANES = np.linspace(-0.3, 0.3, 5)
"""Across the strand, in widths; on a round strand the surface is here 0.936 of the radius above the
axis on average."""
_ABOVE_AXIS = 0.936
_WINDOW_WIDTHS, _LEAST_WINDOW_PX = 6.0, 12.0
"""Half the length of strand around a point that its parabola is fitted to."""
_NARROW = 0.5
_OUTLIER_SIGMAS, _ROUNDS = 3.0, 3
_LEAST_SAMPLES = 6
_PIXEL_SIGMA = 0.55
"""Of a centerline, across it."""
_RADIUS_ERROR = 0.15
"""Standard deviation of a radius seen in the mask, as a share of it."""
_LEAST_SIGMA_M = 1e-5
_SPACING_PX = 2.0


@dataclass(frozen=True, eq=False)
class MetricCurve:
    """``points_m`` (n, 3) in the frame of the camera's pose; ``covariance_m2`` (n, 3, 3) of the
    position across the curve; ``radius_m``; ``measured`` share of its length where there was a
    depth."""

    points_m: FloatArray
    covariance_m2: FloatArray
    radius_m: float
    measured: float

    @property
    def sigma_m(self) -> FloatArray:
        """(n,) standard deviation in the worst direction."""
        return np.asarray(np.sqrt(np.maximum(np.linalg.eigvalsh(self.covariance_m2)[:, -1], 0)))


def metric_curve(
    xy: FloatArray,
    width_px: float,
    depth_m: Float32Array,
    camera: Camera,
    sigma_m: float,
    covered: Sequence[tuple[float, float]] = (),
    count: int | None = None,
) -> MetricCurve | None:
    """The curve of a centerline ``xy`` (n, 2); ``sigma_m`` is the depth's noise, ``covered``
    stretches (u0, u1) under another strand. None where too little depth is known."""
    lengths = arc_lengths(xy)
    samples = max(int(lengths[-1] / _SPACING_PX), _LEAST_SAMPLES)
    line = resample(xy, samples)
    at = np.linspace(0.0, lengths[-1], samples)
    surface = _surface(line, width_px, depth_m)
    for first, last in covered:
        surface[(at >= first * lengths[-1]) & (at <= last * lengths[-1])] = np.nan
    wanted = np.linspace(0.0, lengths[-1], count or len(xy))
    window = max(_WINDOW_WIDTHS * width_px, _LEAST_WINDOW_PX)
    fitted = _fitted(at, surface, wanted, window, sigma_m)
    if fitted is None:
        return None
    depth, depth_sigma, kept = fitted
    places = camera.undistort(point_at(xy, lengths, wanted))
    return _curve(places, width_px, depth, depth_sigma, camera, float(kept.mean()))


def _surface(line: FloatArray, width_px: float, depth_m: Float32Array) -> FloatArray:
    """(n,) depth of the strand's upper side: the middle one of what is known across it; NaN where
    nothing is."""
    steps = np.gradient(line, axis=0)
    normal = steps[:, ::-1] * (-1, 1) / np.maximum(np.hypot(*steps.T), 1e-9)[:, None]
    lanes = line + _LANES[:, None, None] * width_px * normal
    height, width = depth_m.shape
    values = read_nearest(np.where(depth_m > 0, depth_m, np.nan).astype(np.float32), lanes)
    inside = (lanes > -0.5).all(-1) & (lanes[..., 0] < width - 0.5) & (lanes[..., 1] < height - 0.5)
    values = np.where(inside, values, np.nan)
    out = np.full(len(line), np.nan)
    there = np.isfinite(values).any(0)
    out[there] = np.nanmedian(values[:, there], axis=0)
    return out


def _fitted(
    at: FloatArray, surface: FloatArray, wanted: FloatArray, window: float, sigma_m: float
) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Depth (m,) and its standard deviation at ``wanted`` (m,), and which samples were used."""
    kept = np.isfinite(surface)
    if kept.sum() < _LEAST_SAMPLES:
        return None
    values = np.where(kept, surface, 0.0)
    for _ in range(_ROUNDS):
        smooth, _ = _parabolas(at, values, kept, at, window)
        off = np.abs(values - smooth)
        usual = max(1.4826 * float(np.median(off[kept])), _LEAST_SIGMA_M, 0.3 * sigma_m)
        better = np.isfinite(surface) & (off < _OUTLIER_SIGMAS * usual)
        if better.sum() < _LEAST_SAMPLES or (better == kept).all():
            break
        kept = better
    smooth, _ = _parabolas(at, values, kept, at, window)
    residual = (values - smooth)[kept]
    noise = max(float(residual.std()), 0.3 * sigma_m, _LEAST_SIGMA_M) * np.sqrt(_alike(residual))
    depth, gain = _parabolas(at, values, kept, wanted, window)
    # Where the strand bends more than a parabola, as over another one, half the window shows by how
    # much.
    near, near_gain = _parabolas(at, values, kept, wanted, _NARROW * window)
    bias = np.maximum((near - depth) ** 2 - noise**2 * np.maximum(near_gain**2 - gain**2, 0.0), 0.0)
    return depth, np.sqrt((noise * gain) ** 2 + bias), kept


def _parabolas(
    at: FloatArray, values: FloatArray, kept: BoolArray, wanted: FloatArray, window: float
) -> tuple[FloatArray, FloatArray]:
    """Local quadratic regression at ``wanted`` (m,), and the factor by which its error is that of
    one sample. Where few samples are near, the window reaches to the nearest ones."""
    known_at, known_values = at[kept], values[kept]
    away = known_at - wanted[:, None]
    enough = np.sort(np.abs(away), axis=1)[:, min(_LEAST_SAMPLES, len(known_at)) - 1]
    reach = np.maximum(window, 1.5 * enough + 1e-9)[:, None]
    scaled = away / reach
    weights = np.clip(1 - np.abs(scaled) ** 3, 0, None) ** 3
    basis = np.stack([np.ones_like(scaled), scaled, scaled**2], axis=-1)
    normal = np.einsum("mk,mki,mkj->mij", weights, basis, basis) + 1e-6 * np.eye(3)
    rows = np.einsum("mi,mki,mk->mk", np.linalg.inv(normal)[:, 0], basis, weights)
    return np.asarray(rows @ known_values), np.asarray(np.sqrt((rows**2).sum(1)))


def _alike(residual: FloatArray) -> float:
    """How many neighboring samples err as one: 1 + 2 times the sum of their correlations."""
    centered = residual - residual.mean()
    power = float(centered @ centered)
    if power < 1e-18 or len(residual) < 8:
        return 1.0
    correlations = [float(centered[k:] @ centered[:-k]) / power for k in range(1, 4)]
    return 1.0 + 2.0 * sum(max(c, 0.0) for c in correlations)


def _curve(
    places: FloatArray,
    width_px: float,
    depth: FloatArray,
    sigma: FloatArray,
    camera: Camera,
    measured: float,
) -> MetricCurve:
    """Half the thickness below the surface; errors along the ray from the depth, across it from the
    picture."""
    rays = camera.rays(places)
    size = np.linalg.norm(rays, axis=1)
    radius = 0.5 * width_px * depth / camera.focal_px
    points = camera.center + rays * (depth + _ABOVE_AXIS * radius / size)[:, None]
    ray = rays / size[:, None]
    along_ray = (sigma * size) ** 2 + (_RADIUS_ERROR * radius) ** 2
    tangent = np.gradient(points, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1), 1e-12)[:, None]
    across = np.cross(ray, tangent)
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-12)[:, None]
    sideways = (_PIXEL_SIGMA * depth / camera.focal_px) ** 2
    other = np.cross(tangent, across)
    covariance = along_ray[:, None, None] * other[:, :, None] * other[:, None]
    covariance = covariance + sideways[:, None, None] * across[:, :, None] * across[:, None]
    return MetricCurve(points, covariance, float(np.median(radius)), measured)
