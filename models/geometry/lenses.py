"""Lenses: where distortion puts a ray that a pinhole would put elsewhere, and back.

Both kinds of places are on the plane at depth 1: *straight* ones ``(x / z, y / z)``, and *bent*
ones, which the camera matrix takes to pixels of the picture as it was taken. Coefficients are in
OpenCV's order.

A polynomial lens folds at some radius: beyond it, places further out would be seen further in,
which no lens does. All that is beyond is outside of the lens's field, for both directions.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import cv2
import numpy as np

from models.geometry.arrays import FloatArray

DistortionModel = Literal["plumb_bob", "rational_polynomial", "equidistant"]
COUNTS: dict[DistortionModel, tuple[int, ...]] = {
    "plumb_bob": (0, 4, 5),
    "rational_polynomial": (0, 4, 5, 8, 12, 14),
    "equidistant": (0, 4),
}
"""``plumb_bob`` and ``rational_polynomial`` are ROS's names for one polynomial, as long as it has
coefficients."""

_WIDEST_RAD = np.radians(88.0)
"""From the axis: straight places beyond would be farther out than the numbers are good for."""
_TABLE = 4000
"""Angles from the axis at which the bending is known; between them it is interpolated."""
_NEWTON_STEPS = 6
_BLOCK = 8192
"""Places that are straightened together, so that what is computed of them stays in the
processor's cache."""
_MISSED = 1e-4
"""A place that is found again no better than this, in focal lengths, is outside of the field."""


def bends(model: DistortionModel, coefficients: tuple[float, ...]) -> bool:
    """Whether bent places differ from straight ones. An equidistant lens bends even with all
    coefficients 0."""
    return model == "equidistant" or any(coefficients)


def bend(
    straight: FloatArray, model: DistortionModel, coefficients: tuple[float, ...]
) -> FloatArray:
    """(n, 2) straight to bent places; NaN outside of the field."""
    radius = np.hypot(*straight.T)
    inside = radius <= field(model, coefficients)
    bent = np.full(straight.shape, np.nan)
    bent[inside] = _bent(straight[inside], model, coefficients)
    return bent


def straighten(
    bent: FloatArray, model: DistortionModel, coefficients: tuple[float, ...]
) -> FloatArray:
    """(n, 2) bent to straight places; NaN for what no place of the field is bent to.

    Strategy: the radial part is inverted by a table; Newton steps then add what is not radial.
    """
    if len(bent) > _BLOCK:
        blocks = [bent[start : start + _BLOCK] for start in range(0, len(bent), _BLOCK)]
        return np.concatenate([straighten(block, model, coefficients) for block in blocks])
    radii, images = _radial_table(model, coefficients)
    size = np.hypot(*bent.T)
    share = np.interp(size, images, radii) / np.maximum(size, 1e-12)
    straight = np.where(size[:, None] > 1e-12, share[:, None] * bent, bent)
    possible = np.isfinite(size) & (size <= 1.05 * images[-1])
    out = np.full(bent.shape, np.nan)
    if possible.any():
        found = _polished(straight[possible], bent[possible], model, coefficients)
        missed = np.hypot(*(_bent(found, model, coefficients) - bent[possible]).T)
        good = (missed < _MISSED) & (np.hypot(*found.T) <= 1.001 * radii[-1])
        out[np.flatnonzero(possible)[good]] = found[good]
    return out


def field(model: DistortionModel, coefficients: tuple[float, ...]) -> float:
    """Largest radius of straight places that the lens does not fold."""
    return float(_radial_table(model, coefficients)[0][-1])


def bent_field(model: DistortionModel, coefficients: tuple[float, ...]) -> float:
    """The radius of bent places that :func:`field` is seen at."""
    return float(_radial_table(model, coefficients)[1][-1])


def _bent(
    straight: FloatArray, model: DistortionModel, coefficients: tuple[float, ...]
) -> FloatArray:
    if not len(straight):
        return straight
    if model == "equidistant":
        four = np.array(coefficients or (0.0,) * 4)
        out = cv2.fisheye.distortPoints(straight[None], np.eye(3), four)
        return np.asarray(out, np.float64).reshape(-1, 2)
    return _polynomial(straight, (*coefficients, *(0.0,) * 14)[:14])


def _polynomial(straight: FloatArray, coefficients: tuple[float, ...]) -> FloatArray:
    """OpenCV's lens of 14 coefficients: ``cv2.projectPoints`` gives the same, with derivatives by
    all of them, which takes 15 times as long."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, *tilt = coefficients
    x, y = straight.T
    xx, yy, xy = x * x, y * y, 2 * x * y
    rr = xx + yy
    radial = 1 + rr * (k1 + rr * (k2 + rr * k3))
    if k4 or k5 or k6:
        radial /= 1 + rr * (k4 + rr * (k5 + rr * k6))
    bent = np.empty_like(straight)
    bent[:, 0] = x * radial + p1 * xy + p2 * (rr + 2 * xx) + rr * (s1 + rr * s2)
    bent[:, 1] = y * radial + p2 * xy + p1 * (rr + 2 * yy) + rr * (s3 + rr * s4)
    return _tilted(bent, *tilt) if any(tilt) else bent


def _tilted(bent: FloatArray, about_x_rad: float, about_y_rad: float) -> FloatArray:
    """What is seen on a sensor that is turned about its axes by these angles."""
    cx, sx = np.cos(about_x_rad), np.sin(about_x_rad)
    cy, sy = np.cos(about_y_rad), np.sin(about_y_rad)
    turn = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array(
        [[1, 0, 0], [0, cx, sx], [0, -sx, cx]]
    )
    seen = bent @ turn[:, :2].T + turn[:, 2]
    return np.asarray((turn[2, 2] * seen[:, :2] - turn[:2, 2] * seen[:, 2:]) / seen[:, 2:])


def _polished(
    straight: FloatArray, bent: FloatArray, model: DistortionModel, coefficients: tuple[float, ...]
) -> FloatArray:
    step = 1e-6
    for _ in range(_NEWTON_STEPS):
        here = _bent(straight, model, coefficients)
        columns = [
            (_bent(straight + step * axis, model, coefficients) - here) / step for axis in np.eye(2)
        ]
        (a, c), (b, d) = columns[0].T, columns[1].T
        off = bent - here
        determinant = a * d - b * c
        safe = np.where(np.abs(determinant) > 1e-9, determinant, np.inf)
        move = (
            np.stack([d * off[:, 0] - b * off[:, 1], a * off[:, 1] - c * off[:, 0]], axis=1)
            / safe[:, None]
        )
        straight = straight + move
        if np.abs(move).max(initial=0.0) < 1e-10:
            break
    return straight


@lru_cache(maxsize=64)
def _radial_table(
    model: DistortionModel, coefficients: tuple[float, ...]
) -> tuple[FloatArray, FloatArray]:
    """Radii of straight places and those they are bent to, both increasing, up to where the lens
    folds."""
    angle = np.linspace(0.0, _WIDEST_RAD, _TABLE)
    radius = np.tan(angle)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        image = _radial(angle, model, coefficients)
        rises = np.isfinite(image[1:]) & (np.diff(image) > 0)
    end = _TABLE if rises.all() else int(np.argmin(rises)) + 1
    return radius[:end], image[:end]


def _radial(
    angle: FloatArray, model: DistortionModel, coefficients: tuple[float, ...]
) -> FloatArray:
    """Bent radius of straight places seen at ``angle`` from the axis, without what is not
    radial."""
    if model == "equidistant":
        k = coefficients or (0.0,) * 4
        return np.asarray(angle * (1 + sum(c * angle ** (2 * n) for n, c in enumerate(k, start=1))))
    radius = np.tan(angle)
    k1, k2, _, _, k3, k4, k5, k6 = (*coefficients, *(0.0,) * 14)[:8]
    over = 1 + k1 * radius**2 + k2 * radius**4 + k3 * radius**6
    under = 1 + k4 * radius**2 + k5 * radius**4 + k6 * radius**6
    # A denominator that has passed through 0 has turned the picture over.
    crossed = np.cumsum(under <= 0) > 0
    return np.asarray(np.where(crossed, np.nan, radius * over / under))
