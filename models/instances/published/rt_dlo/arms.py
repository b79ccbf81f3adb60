"""Strand ends that look for their continuation, at an intersection or across a gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import FloatArray
from models.geometry.directions import angle_between, unit
from models.instances.published.rt_dlo.graph import Vertices

ARM_VERTICES = 12
ARM_RADII = 5.0
"""How much of a strand gives its direction, width and color."""
_TURN_SCALE = np.deg2rad(50.0)
"""Turn at which a continuation counts 1/e."""
_COLOR_SCALE = 100.0
_BRIGHTNESS_WEIGHT = 0.2
"""RGB distance at which a continuation counts 1/e; how much a common change of R, G and B weighs in
it."""


@dataclass(frozen=True, eq=False)
class Arm:
    """The last stretch of a strand: end vertex and place, direction out of the end, half width, RGB
    color."""

    vertex: int
    xy: FloatArray
    outward: FloatArray
    radius: float
    color: FloatArray


def arm_of(chain: Sequence[int], vertices: Vertices) -> Arm:
    """The arm that ends in the chain's first vertex. A chain of one vertex has no direction."""
    near = list(chain[:ARM_VERTICES])
    away = np.hypot(*(vertices.xy[near] - vertices.xy[near[0]]).T)
    near = near[: 1 + max(1, int(np.searchsorted(away, ARM_RADII * vertices.typical_radius)))]
    outward = unit(vertices.xy[near[0]] - vertices.xy[near[-1]])
    middle = len(near) // 2
    radius = float(np.sort(vertices.radii[near])[middle])
    return Arm(
        near[0],
        vertices.xy[near[0]],
        outward,
        radius,
        np.sort(vertices.colors[near], axis=0)[middle],
    )


def continuation(a: Arm, b: Arm) -> float:
    """How well arm ``b`` continues arm ``a``, 0 to 1.

    The thesis's ``s_int`` (3.5.4) with the directions of the strands, times how well tangents,
    widths and colors agree. 0 where either arm would have to turn back.
    """
    link = unit(b.xy - a.xy)
    leaving, arriving = float(a.outward @ link), -float(b.outward @ link)
    if min(leaving, arriving) <= 0:
        return 0.0
    turn = float(angle_between(a.outward, -b.outward))
    width = min(a.radius, b.radius) / max(a.radius, b.radius)
    return (
        leaving
        * arriving
        * width
        * _likeness(turn / _TURN_SCALE)
        * color_likeness(a.color, b.color)
    )


def color_likeness(a: FloatArray, b: FloatArray) -> float:
    """1 for equal RGB colors, towards 0 for others; light and shadow on one cable count little."""
    difference = a - b
    brightness = float(difference.mean())
    chroma = float(np.sum((difference - brightness) ** 2))
    return _likeness(float(np.sqrt(chroma + _BRIGHTNESS_WEIGHT * 3 * brightness**2)) / _COLOR_SCALE)


def _likeness(deviation: float) -> float:
    return float(np.exp(-(deviation**2)))
