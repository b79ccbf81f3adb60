"""The reprojection on a picture, for people."""

from __future__ import annotations

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.cameras import Camera
from models.geometry.directions import quarter_turned, tangents
from models.geometry.painting import DARK, Color, stroke
from models.reconstruction.curves import Curve

_TARGET = (255, 214, 10)
_OTHERS = (
    (64, 196, 255),
    (255, 110, 180),
    (120, 230, 120),
    (255, 150, 60),
    (190, 150, 255),
    (0, 210, 190),
    (230, 70, 60),
    (200, 210, 60),
    (245, 245, 245),
    (150, 110, 80),
)
_DROPPED = (220, 40, 30)


def reprojection(
    image: ByteArray, camera: Camera, curves: list[Curve], dropped: str | None = None
) -> ByteArray:
    """Copy of (H, W, 3) RGB ``image`` with the curves' centerlines and outlines as the camera
    should see them; the first one is the target. ``dropped``: why the view took no part, written
    into it."""
    picture = image.copy()
    unit = max(1.0, min(image.shape[:2]) / 480)
    for number, curve in enumerate(curves):
        color = _TARGET if number == 0 else _OTHERS[(number - 1) % len(_OTHERS)]
        points = curve.spline.at(np.linspace(0, 1, 400))
        xy = camera.project_to_picture(points)
        _line(picture, xy, DARK, 3 * unit)
        _line(picture, xy, color, 1.4 * unit)
        if np.isfinite(curve.mean_radius_m):
            for side in _outline(points, camera, curve.mean_radius_m):
                _line(picture, side, color, 1)
    if dropped:
        corner = picture.shape[1] - 1, picture.shape[0] - 1
        cv2.rectangle(picture, (0, 0), corner, _DROPPED, round(4 * unit))
        place, font = (10, round(24 * unit)), cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(picture, dropped, place, font, 0.5 * unit, _DROPPED, 1)
    return picture


def _outline(points: FloatArray, camera: Camera, radius: float) -> list[FloatArray]:
    ideal = camera.project(points)
    half = radius * camera.focal_px / camera.in_camera(points)[:, 2]
    normal = quarter_turned(tangents(ideal)) * half[:, None]
    return [camera.distort(ideal + normal), camera.distort(ideal - normal)]


def _line(picture: ByteArray, xy: FloatArray, color: Color, thickness: float) -> None:
    """Pieces between points that are not in front of the camera, or far outside the picture, are
    left out."""
    limit = 4 * max(picture.shape[:2])
    good = np.isfinite(xy).all(axis=1) & (np.abs(np.nan_to_num(xy)) < limit).all(axis=1)
    for piece in np.split(np.arange(len(xy)), np.flatnonzero(np.diff(good)) + 1):
        if len(piece) > 1 and good[piece[0]]:
            stroke(picture, xy[piece], color, thickness, cv2.LINE_AA)
