"""The picture of an action for people: where it holds, picks and places, and the arc between."""

from __future__ import annotations

import cv2
import numpy as np

from models.disentangling.plan import Action
from models.geometry import painting
from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.painting import WHITE, Color

_MOVED: Color = (255, 220, 0)
_DISC, _RING, _JAW = 5.0, 6.0, 11.0
"""Radii of the pick's disc and of the place's ring, and half of how far the fingers are open."""
_FINGER = 0.4
"""Length of a finger's stroke, in that half."""
_BELOW = 19.0
"""How far a tag is from its place."""


def draw_action(picture: ByteArray, action: Action) -> ByteArray:
    """A copy with the held place, the pick (disc), the arc and the place (ring)."""
    out = picture.copy()
    unit = painting.unit_of(picture)
    painting.smooth(out, action.trajectory, painting.DARK, painting.RIM)
    painting.smooth(out, action.trajectory, WHITE, painting.LINE)
    start, stop = (painting.pixel(action.trajectory[k]) for k in (-3, -1))
    thick = max(1, round(painting.LINE * unit))
    cv2.arrowedLine(out, start, stop, WHITE, thick, cv2.LINE_AA, tipLength=0.9)
    for grasp in (action.hold, action.pick, action.place):
        _jaw(out, np.array(grasp.xy), grasp.angle, _JAW * unit)
    painting.disc(out, action.pick.xy, _MOVED, _DISC)
    painting.ring(out, action.place.xy, _MOVED, _RING)
    for text, grasp, side in (
        ("hold", action.hold, 1),
        ("pick", action.pick, -1),
        ("place", action.place, -1),
    ):
        painting.tag(out, text, np.add(grasp.xy, (0, side * _BELOW * unit)), WHITE)
    return out


def _jaw(picture: ByteArray, xy: FloatArray, angle: float, reach: float) -> None:
    """Two short strokes across the section: the gripper's fingers."""
    across = reach * np.array([-np.sin(angle), np.cos(angle)])
    for side in (across, -across):
        ends = np.stack((xy + (1 - _FINGER) * side, xy + side))
        painting.smooth(picture, ends, WHITE, painting.LINE)
