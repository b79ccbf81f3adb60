"""The picture of a topology for people, over the photograph; and the strokes that such pictures are
made of."""

from __future__ import annotations

import colorsys
from dataclasses import replace

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.polylines import arc_lengths, point_at
from models.topology.scene import Crossing, Place, Topology

Color = tuple[int, int, int]
BRANCH: Color = (230, 40, 40)
CROSSING: Color = (40, 120, 255)
DARK: Color = (20, 20, 20)
WHITE: Color = (255, 255, 255)
_SHIFT = 4
_DIM = 0.55
_UNSURE = 0.65
"""Crossings whose order is less certain get a question mark."""


def section_color(k: int) -> Color:
    """Hues a golden section apart, none of them the red of branch-points."""
    hue = 0.10 + 0.75 * ((k * 0.61803398875) % 1.0)
    red, green, blue = colorsys.hsv_to_rgb(hue, 0.75, 1.0)
    return round(255 * red), round(255 * green), round(255 * blue)


def overlay(
    ground: ByteArray,
    topology: Topology,
    names: dict[int, str] | None = None,
    longest: int | None = None,
) -> ByteArray:
    """``(H, W, 3)`` RGB: sections with their ids (or ``names`` by index), branch-points red,
    crossings blue; the lower section is interrupted there. The picture is reduced to a ``longest``
    side before it is drawn on."""
    if longest is not None and max(ground.shape[:2]) > longest:
        ground, topology = _reduced(ground, topology, -(-max(ground.shape[:2]) // longest))
    picture = np.asarray(cv2.convertScaleAbs(ground, alpha=_DIM), np.uint8)
    unit = max(1.0, min(ground.shape[:2]) / 360)
    for k, section in enumerate(topology.sections):
        draw_line(picture, section.xy, DARK, 4 * unit, section.closed)
        draw_line(picture, section.xy, section_color(k), 2.2 * unit, section.closed)
    for crossing in topology.crossings:
        _draw_crossing(picture, topology, crossing, unit)
    for x, y in topology.nodes_xy[np.unique(topology.links)] if len(topology.links) else ():
        cv2.circle(picture, (round(x), round(y)), max(1, round(0.9 * unit)), WHITE, -1, cv2.LINE_AA)
    for branch in topology.branch_points:
        draw_disc(picture, branch.xy, BRANCH, 5 * unit)
    for k, section in enumerate(topology.sections):
        middle = section.xy[len(section.xy) // 2]
        draw_tag(picture, (names or {}).get(k, str(k + 1)), middle, section_color(k), 0.4 * unit)
    return picture


def _reduced(ground: ByteArray, topology: Topology, factor: int) -> tuple[ByteArray, Topology]:
    """By a whole number; a rest at the right and lower border is cut off. Centers are at ``(k +
    0.5) s - 0.5``."""
    scale = 1 / factor
    height, width = (max(1, side // factor) for side in ground.shape[:2])
    part = ground[: height * factor, : width * factor]

    def moved(xy: tuple[float, float]) -> tuple[float, float]:
        return (xy[0] + 0.5) * scale - 0.5, (xy[1] + 0.5) * scale - 0.5

    sections = (
        replace(s, xy=(s.xy + 0.5) * scale - 0.5, width=s.width * scale) for s in topology.sections
    )
    reduced = replace(
        topology,
        sections=tuple(sections),
        branch_points=tuple(replace(b, xy=moved(b.xy)) for b in topology.branch_points),
        crossings=tuple(replace(c, xy=moved(c.xy)) for c in topology.crossings),
        nodes_xy=(topology.nodes_xy + 0.5) * scale - 0.5,
    )
    return np.asarray(
        cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA), np.uint8
    ), reduced


def _draw_crossing(picture: ByteArray, topology: Topology, crossing: Crossing, unit: float) -> None:
    upper, lower = (
        topology.sections[crossing.over.section],
        topology.sections[crossing.under.section],
    )
    draw_line(
        picture,
        _around(topology, crossing.under, max(0.7 * upper.width, 6 * unit)),
        DARK,
        4 * unit,
        False,
    )
    bridge = _around(topology, crossing.over, max(0.9 * lower.width, 8 * unit))
    draw_line(picture, bridge, WHITE, 5 * unit, False)
    draw_line(picture, bridge, section_color(crossing.over.section), 3 * unit, False)
    cv2.circle(
        picture,
        pixel(np.array(crossing.xy)),
        round(9 * unit),
        CROSSING,
        max(1, round(2 * unit)),
        cv2.LINE_AA,
    )
    if crossing.order_score < _UNSURE:
        draw_tag(picture, "?", np.array(crossing.xy) + 14 * unit, WHITE, 0.4 * unit)


def _around(topology: Topology, place: Place, reach: float) -> FloatArray:
    section = topology.sections[place.section]
    lengths = arc_lengths(section.xy)
    at = place.u * lengths[-1]
    return point_at(section.xy, lengths, np.linspace(at - reach, at + reach, 9))


def draw_line(picture: ByteArray, xy: FloatArray, color: Color, width: float, closed: bool) -> None:
    fixed = np.rint(xy * (1 << _SHIFT)).astype(np.int32)
    cv2.polylines(picture, [fixed], closed, color, max(1, round(width)), cv2.LINE_AA, _SHIFT)


def draw_disc(picture: ByteArray, xy: tuple[float, float], color: Color, radius: float) -> None:
    place = pixel(np.array(xy))
    cv2.circle(picture, place, max(2, round(1.35 * radius)), WHITE, -1, cv2.LINE_AA)
    cv2.circle(picture, place, max(1, round(radius)), color, -1, cv2.LINE_AA)


def draw_tag(picture: ByteArray, text: str, xy: FloatArray, color: Color, scale: float) -> None:
    """Dark text on a box of the color, kept inside the picture."""
    thick = max(1, round(2 * scale))
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, thick)
    reach = np.array([width / 2 + 4, height / 2 + 4])
    limit = np.maximum(reach, np.array(picture.shape[1::-1]) - 1 - reach)
    center = np.clip(xy, reach, limit)
    low, high = pixel(center - reach), pixel(center + reach)
    cv2.rectangle(picture, low, high, color, -1)
    cv2.putText(
        picture,
        text,
        (low[0] + 4, high[1] - 4),
        cv2.FONT_HERSHEY_SIMPLEX,
        scale,
        DARK,
        thick,
        cv2.LINE_AA,
    )


def pixel(xy: FloatArray) -> tuple[int, int]:
    x, y = np.rint(xy).astype(int).tolist()
    return x, y
