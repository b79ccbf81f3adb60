"""The picture of an action for people: where it holds, picks and places, and the arc between."""

from __future__ import annotations

import cv2
import numpy as np

from models.disentangling.plan import Action
from models.geometry.arrays import ByteArray, FloatArray
from models.topology.overlay import DARK, WHITE, draw_disc, draw_line, draw_tag, pixel


def draw_action(picture: ByteArray, action: Action) -> ByteArray:
    """A copy with the held place (square), the pick (disc), the arc and the place (ring)."""
    out = picture.copy()
    unit = max(1.0, min(picture.shape[:2]) / 360)
    draw_line(out, action.trajectory, DARK, 5 * unit, False)
    draw_line(out, action.trajectory, WHITE, 2.5 * unit, False)
    start, stop = pixel(action.trajectory[-3]), pixel(action.trajectory[-1])
    cv2.arrowedLine(out, start, stop, WHITE, max(1, round(2.5 * unit)), cv2.LINE_AA, tipLength=0.9)
    x, y = pixel(np.array(action.hold.xy))
    reach = round(7 * unit)
    cv2.rectangle(
        out, (x - reach, y - reach), (x + reach, y + reach), WHITE, max(1, round(2 * unit))
    )
    for grasp in (action.hold, action.pick, action.place):
        _jaw(out, np.array(grasp.xy), grasp.angle, 11 * unit)
    draw_disc(out, action.pick.xy, (255, 220, 0), 5 * unit)
    cv2.circle(
        out,
        pixel(np.array(action.place.xy)),
        round(6 * unit),
        (255, 220, 0),
        max(1, round(2 * unit)),
    )
    for text, grasp, below in (
        ("hold", action.hold, 20),
        ("pick", action.pick, -18),
        ("place", action.place, -18),
    ):
        draw_tag(out, text, np.array(grasp.xy) + np.array([0, below * unit]), WHITE, 0.4 * unit)
    return out


def _jaw(picture: ByteArray, xy: FloatArray, angle: float, reach: float) -> None:
    """Two short strokes across the section: the gripper's fingers."""
    across = reach * np.array([-np.sin(angle), np.cos(angle)])
    for sign in (1, -1):
        draw_line(
            picture, np.stack((xy + sign * 0.6 * across, xy + sign * across)), WHITE, 3, False
        )
