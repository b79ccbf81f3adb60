"""The picture of a scene for people: tint, centerlines, endpoints, crossings, ids.

At a crossing the upper centerline runs through and the lower one is interrupted; an uncertain order
has a ``?``. Endpoints: a filled disc is free, a ring is hidden under another DLO, none is drawn at
the border.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.polylines import arc_lengths, point_at
from models.instances.drawing import palette, piece_around, stroke
from models.instances.scene import Crossing, Instance, Scene

_TINT = 0.4
_UNCERTAIN = 0.65
"""Crossing scores below this get a question mark."""
_DARK = (20, 20, 20)
_WHITE = (255, 255, 255)

Color = tuple[int, int, int]


def overlay(image: ByteArray, scene: Scene, longest: int | None = None) -> ByteArray:
    """RGB copy of ``image`` (H, W, 3) with the scene drawn in, reduced to a ``longest`` side first:
    drawing on a large photograph takes longer than finding what is in it. Line widths follow the
    picture's size."""
    if longest is not None and max(image.shape[:2]) > longest:
        image, scene = _reduced(image, scene, -(-max(image.shape[:2]) // longest))
    picture = _tinted(image, scene.labels)
    unit = max(1.0, min(image.shape[:2]) / 360.0)
    for number, instance in enumerate(scene.instances, start=1):
        stroke(picture, instance.centerline_xy, _DARK, 3.6 * unit, cv2.LINE_AA)
        stroke(picture, instance.centerline_xy, _color(number), 2 * unit, cv2.LINE_AA)
    for crossing in scene.crossings:
        _draw_crossing(picture, crossing, scene, unit)
    for number, instance in enumerate(scene.instances, start=1):
        _draw_endpoints(picture, instance, _color(number), unit)
    if min(image.shape[:2]) >= 64:
        for number, instance in enumerate(scene.instances, start=1):
            _draw_tag(
                picture,
                str(number),
                _tag_place(instance, number, scene),
                _color(number),
                0.45 * unit,
            )
    return picture


def _reduced(image: ByteArray, scene: Scene, factor: int) -> tuple[ByteArray, Scene]:
    """By a whole number, which is several times faster; a rest at the right and lower border is cut
    off. Pixel centers are at ``(k + 0.5) s - 0.5``."""
    scale = 1 / factor
    height, width = (max(1, side // factor) for side in image.shape[:2])
    part = slice(height * factor), slice(width * factor)

    def moved(xy: tuple[float, float]) -> tuple[float, float]:
        return (xy[0] + 0.5) * scale - 0.5, (xy[1] + 0.5) * scale - 0.5

    instances = tuple(
        replace(
            i,
            centerline_xy=(i.centerline_xy + 0.5) * scale - 0.5,
            width_px=i.width_px * scale,
            endpoints=tuple(replace(e, xy=moved(e.xy)) for e in i.endpoints),
        )
        for i in scene.instances
    )
    crossings = tuple(replace(c, xy=moved(c.xy)) for c in scene.crossings)
    labels, small = (
        np.asarray(cv2.resize(array[part], (width, height), interpolation=how), np.uint8)
        for array, how in ((scene.labels, cv2.INTER_NEAREST), (image, cv2.INTER_AREA))
    )
    return small, Scene(instances, crossings, labels)


def _tinted(image: ByteArray, labels: ByteArray) -> ByteArray:
    picture = image.copy()
    painted = labels > 0
    mixed = (1 - _TINT) * image[painted] + _TINT * palette()[labels[painted]]
    picture[painted] = np.rint(mixed).astype(np.uint8)
    return picture


def _color(number: int) -> Color:
    red, green, blue = (int(c) for c in palette()[number])
    return red, green, blue


def _draw_crossing(picture: ByteArray, crossing: Crossing, scene: Scene, unit: float) -> None:
    upper = scene.instances[crossing.over.instance - 1]
    lower = scene.instances[crossing.under.instance - 1]
    # The lower line stops under a dark bridge as wide as the upper strand; the upper line is drawn
    # over it.
    gap = piece_around(lower, crossing.under.u, max(0.7 * upper.width_px, 5 * unit))
    stroke(picture, gap, _DARK, 3.6 * unit, cv2.LINE_AA)
    bridge = piece_around(upper, crossing.over.u, max(0.9 * lower.width_px, 7 * unit))
    stroke(picture, bridge, _DARK, 7 * unit, cv2.LINE_AA)
    stroke(picture, bridge, _WHITE, 5.5 * unit, cv2.LINE_AA)
    stroke(picture, bridge, _color(crossing.over.instance), 3 * unit, cv2.LINE_AA)
    if crossing.score < _UNCERTAIN:
        _draw_tag(picture, "?", np.array(crossing.xy) + 12 * unit, _WHITE, 0.4 * unit)


def _draw_endpoints(picture: ByteArray, instance: Instance, color: Color, unit: float) -> None:
    radius = max(2, round(4 * unit))
    for endpoint in instance.endpoints:
        if endpoint.kind == "border":
            continue
        center = (round(endpoint.xy[0]), round(endpoint.xy[1]))
        inside = color if endpoint.kind == "free" else _DARK
        cv2.circle(picture, center, radius + max(1, round(unit)), _WHITE, -1, cv2.LINE_AA)
        cv2.circle(picture, center, radius, inside, -1, cv2.LINE_AA)


def _tag_place(instance: Instance, number: int, scene: Scene) -> FloatArray:
    """A point of the centerline near its middle that is not at a crossing."""
    taken = [p.u for c in scene.crossings for p in (c.over, c.under) if p.instance == number]
    places = np.array([0.5, 0.42, 0.58, 0.34, 0.66, 0.25, 0.75])
    room = np.min(np.abs(places[:, None] - np.array([*taken, 9.0])), axis=1)
    chosen = places[int(np.argmax(np.minimum(room, 0.12) - 0.2 * np.abs(places - 0.5)))]
    lengths = arc_lengths(instance.centerline_xy)
    return point_at(instance.centerline_xy, lengths, chosen * lengths[-1])


def _draw_tag(picture: ByteArray, text: str, xy: FloatArray, color: Color, scale: float) -> None:
    """Dark text on a box of the color, centered at ``xy`` and kept inside the picture."""
    thickness = max(1, round(2 * scale))
    (width, height), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, scale, thickness)
    margin = max(2, round(6 * scale))
    reach = np.array([width / 2 + margin, height / 2 + margin])
    center = np.clip(xy, reach, np.maximum(reach, np.array(picture.shape[1::-1]) - 1 - reach))
    low, high = (
        np.rint(center - reach).astype(int).tolist(),
        np.rint(center + reach).astype(int).tolist(),
    )
    cv2.rectangle(picture, low, high, color, -1)
    cv2.rectangle(picture, low, high, _DARK, max(1, margin // 3))
    place = (low[0] + margin, high[1] - margin)
    cv2.putText(
        picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, scale, _DARK, thickness, cv2.LINE_AA
    )
