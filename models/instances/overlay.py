"""The picture of a scene for people: tint, centerlines, endpoints, crossings, ids.

At a crossing the upper centerline runs through and the lower one is interrupted; an uncertain order
has a ``?``. Endpoints: a filled disc is free, a ring is hidden under another DLO, none is drawn at
the border.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from models.geometry import painting
from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.painting import DARK, Color
from models.geometry.polylines import arc_lengths, point_at
from models.instances.drawing import palette
from models.instances.scene import Instance, Scene

_TINT = 0.4
_END = 4.0
"""Radius of an endpoint."""
_TAGGED_PX = 64
"""Smaller pictures have no room for ids."""
_TAG_PLACES = np.array([0.5, 0.42, 0.58, 0.34, 0.66, 0.25, 0.75])
"""Where along a DLO its id may be, the best first."""
_TAG_ROOM = 0.12
"""How far from a crossing an id is that needs no more room, in shares of the length."""


def overlay(image: ByteArray, scene: Scene, longest: int | None = None) -> ByteArray:
    """RGB copy of ``image`` (H, W, 3) with the scene drawn in, reduced to a ``longest`` side first:
    drawing on a large photograph takes longer than finding what is in it. Line widths follow the
    picture's size."""
    steps = painting.steps_to(image, longest)
    if steps > 1:
        image, scene = painting.smaller(image, steps), _reduced(scene, steps)
    picture = _tinted(image, scene.labels)
    instances = scene.instances
    for number, instance in enumerate(instances, start=1):
        painting.centerline(picture, instance.centerline_xy, _color(number))
    for crossing in scene.crossings:
        over, under = (
            (instances[p.instance - 1].centerline_xy, p.u, instances[p.instance - 1].width_px)
            for p in (crossing.over, crossing.under)
        )
        painting.crossing(picture, over, under, _color(crossing.over.instance))
        if crossing.score < painting.UNSURE_BELOW:
            painting.question_mark(picture, crossing.xy)
    for number, instance in enumerate(instances, start=1):
        for endpoint in instance.endpoints:
            if endpoint.kind != "border":
                inside = _color(number) if endpoint.kind == "free" else DARK
                painting.disc(picture, endpoint.xy, inside, _END)
    if min(image.shape[:2]) >= _TAGGED_PX:
        for number, instance in enumerate(instances, start=1):
            painting.tag(picture, str(number), _tag_place(instance, number, scene), _color(number))
    return picture


def _reduced(scene: Scene, steps: int) -> Scene:
    instances = tuple(
        replace(
            i,
            centerline_xy=painting.moved(i.centerline_xy, steps),
            width_px=i.width_px / steps,
            endpoints=tuple(replace(e, xy=painting.moved_point(e.xy, steps)) for e in i.endpoints),
        )
        for i in scene.instances
    )
    crossings = tuple(replace(c, xy=painting.moved_point(c.xy, steps)) for c in scene.crossings)
    return Scene(instances, crossings, painting.smaller(scene.labels, steps, cv2.INTER_NEAREST))


def _tinted(image: ByteArray, labels: ByteArray) -> ByteArray:
    picture = image.copy()
    painted = labels > 0
    mixed = (1 - _TINT) * image[painted] + _TINT * palette()[labels[painted]]
    picture[painted] = np.rint(mixed).astype(np.uint8)
    return picture


def _color(number: int) -> Color:
    red, green, blue = (int(c) for c in palette()[number])
    return red, green, blue


def _tag_place(instance: Instance, number: int, scene: Scene) -> FloatArray:
    """A point of the centerline near its middle that is not at a crossing."""
    taken = [p.u for c in scene.crossings for p in (c.over, c.under) if p.instance == number]
    away = np.abs(_TAG_PLACES[:, None] - np.array([*taken, np.inf])).min(axis=1)
    room = np.minimum(away, _TAG_ROOM)
    chosen = _TAG_PLACES[np.argmax(room - 0.2 * np.abs(_TAG_PLACES - 0.5))]
    lengths = arc_lengths(instance.centerline_xy)
    return point_at(instance.centerline_xy, lengths, chosen * lengths[-1])
