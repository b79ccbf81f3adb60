"""The picture of a topology for people, over the photograph."""

from __future__ import annotations

import cv2
import numpy as np

from models.geometry import painting
from models.geometry.arrays import ByteArray
from models.geometry.painting import Color
from models.topology.scene import Topology

_BRANCH: Color = (230, 40, 40)
_CROSSING: Color = (40, 120, 255)
_DIM = 0.55
_NODE, _JOINT, _AROUND = 0.5, 5.0, 9.0
"""Radii of nodes, branch-points and the rings around crossings."""
_FIRST_HUE, _HUES, _SATURATION = 0.10, 0.75, 0.75
"""Colors of sections: none is the red of branch-points."""


def section_color(k: int) -> Color:
    """Hues a golden section apart."""
    hue = _FIRST_HUE + _HUES * (k * painting.GOLDEN % 1.0)
    return painting.color_of(hue, _SATURATION, 1.0)


def overlay(
    ground: ByteArray,
    topology: Topology,
    names: dict[int, str] | None = None,
    longest: int | None = None,
) -> ByteArray:
    """``(H, W, 3)`` RGB: sections with their ids (or ``names`` by index), branch-points red,
    crossings blue; the lower section is interrupted there. The picture is reduced to a ``longest``
    side before it is drawn on."""
    steps = painting.steps_to(ground, longest)
    if steps > 1:
        ground, topology = painting.smaller(ground, steps), topology.at_scale(1 / steps)
    picture = np.asarray(cv2.convertScaleAbs(ground, alpha=_DIM), np.uint8)
    sections = topology.sections
    for k, section in enumerate(sections):
        painting.centerline(picture, section.xy, section_color(k), section.closed)
    for crossing in topology.crossings:
        over, under = (
            (sections[place.section].xy, place.u, sections[place.section].width)
            for place in (crossing.over, crossing.under)
        )
        painting.crossing(picture, over, under, section_color(crossing.over.section))
        painting.ring(picture, crossing.xy, _CROSSING, _AROUND)
        if crossing.order_score < painting.UNSURE_BELOW:
            painting.question_mark(picture, crossing.xy)
    for xy in topology.nodes_xy[np.unique(topology.links)] if len(topology.links) else ():
        painting.disc(picture, xy, painting.WHITE, _NODE, rimmed=False)
    for branch in topology.branch_points:
        painting.disc(picture, branch.xy, _BRANCH, _JOINT)
    for k, section in enumerate(sections):
        middle = section.xy[len(section.xy) // 2]
        painting.tag(picture, (names or {}).get(k, str(k + 1)), middle, section_color(k))
    return picture
