"""The picture of a scene for people: tint, centerlines, endpoints, crossings, ids.

At a crossing the upper centerline runs through and the lower one is interrupted; an uncertain order
has a ``?``. Endpoints: a filled disc is free, a ring is hidden under another DLO, none is drawn at
the border.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

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


def overlay(image: ByteArray, scene: Scene, longest: int | None = None) -> ByteArray:
    """RGB copy of ``image`` (H, W, 3) with the scene drawn in, reduced to a ``longest`` side first:
    drawing on a large photograph takes longer than finding what is in it. Line widths follow the
    picture's size."""
    steps = painting.steps_to(image, longest)
    if steps > 1:
        labels = painting.smaller(scene.labels, steps, cv2.INTER_NEAREST)
        image, scene = painting.smaller(image, steps), scene.at_scale(1 / steps)
        scene = replace(scene, labels=labels)
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
    for number, instance in enumerate(instances, start=1):
        painting.tag(picture, str(number), _tag_place(instance, number, scene), _color(number))
    return picture


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
    """The middle of the longest piece of the centerline between crossings and ends."""
    taken = [p.u for c in scene.crossings for p in (c.over, c.under) if p.instance == number]
    first, last = max(pairwise([0.0, *sorted(taken), 1.0]), key=lambda piece: piece[1] - piece[0])
    lengths = arc_lengths(instance.centerline_xy)
    return point_at(instance.centerline_xy, lengths, (first + last) / 2 * lengths[-1])
