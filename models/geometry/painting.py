"""Lines, discs and tags of the pictures for people, and how such a picture is reduced. Sizes are
given for a picture 360 px high and follow its size."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.polylines import around

Color = tuple[int, int, int]
Place = FloatArray | tuple[float, float]
DARK: Color = (20, 20, 20)
WHITE: Color = (255, 255, 255)
_FRACTION_BITS = 4
"""Of OpenCV's fixed-point coordinates."""
_USUAL_HEIGHT = 360.0
LINE, OUTLINE, RIM = 2.0, 3.6, 5.5
"""Widths of a centerline, of the dark line under it, and of the white one under a line that runs
over another."""
_GAP, _OVER = 0.7, 0.9
"""How far the lower line stops before a crossing, in widths of the upper strand, and how far the
upper one is drawn anew, in widths of the lower."""
_SHORTEST = 6.0
TEXT = 0.42
"""Size of the letters of a tag."""
UNSURE_BELOW = 0.65
"""A crossing whose order is less certain gets a question mark."""
_ASIDE = 13.0
"""How far from the crossing, to the right and down."""
GOLDEN = 0.61803398875
"""Golden section: hues so far apart on the circle of colors differ most from their neighbors."""


def color_of(hue: float, saturation: float, value: float) -> Color:
    """RGB, 0 to 255, of HSV, 0 to 1."""
    red, green, blue = (round(255 * part) for part in colorsys.hsv_to_rgb(hue, saturation, value))
    return red, green, blue


def unit_of(picture: ByteArray) -> float:
    """What sizes are multiplied by; small pictures have lines of one pixel all the same."""
    return max(1.0, min(picture.shape[:2]) / _USUAL_HEIGHT)


def stroke(
    picture: ByteArray,
    points_xy: FloatArray,
    color: int | Color,
    width_px: float,
    line: int = cv2.LINE_8,
    closed: bool = False,
) -> None:
    """Paint a polyline of this width, clipped to the picture."""
    fixed = np.rint(points_xy * (1 << _FRACTION_BITS)).astype(np.int32)
    width = max(1, round(width_px))
    cv2.polylines(picture, [fixed], closed, color, width, line, _FRACTION_BITS)


def smooth(
    picture: ByteArray, points_xy: FloatArray, color: Color, width: float, closed: bool = False
) -> None:
    """The same with soft edges, ``width`` in units."""
    stroke(picture, points_xy, color, width * unit_of(picture), cv2.LINE_AA, closed)


def centerline(picture: ByteArray, xy: FloatArray, color: Color, closed: bool = False) -> None:
    smooth(picture, xy, DARK, OUTLINE, closed)
    smooth(picture, xy, color, LINE, closed)


def crossing(
    picture: ByteArray,
    over: tuple[FloatArray, float, float],
    under: tuple[FloatArray, float, float],
    color: Color,
) -> None:
    """A crossing of two centerlines, each with where along it (0 to 1) and how wide its strand is:
    the lower line is interrupted, the upper one in its ``color`` runs through."""
    (upper, at, width), (lower, below, other) = over, under
    least = _SHORTEST * unit_of(picture)
    smooth(picture, around(lower, below, max(_GAP * width, least)), DARK, OUTLINE)
    piece = around(upper, at, max(_OVER * other, least))
    smooth(picture, piece, WHITE, RIM)
    smooth(picture, piece, color, LINE)


def disc(picture: ByteArray, xy: Place, color: Color, radius: float, rimmed: bool = True) -> None:
    place, unit = pixel(np.array(xy)), unit_of(picture)
    inside = max(1, round(radius * unit))
    if rimmed:
        cv2.circle(picture, place, inside + max(1, round(unit)), WHITE, -1, cv2.LINE_AA)
    cv2.circle(picture, place, inside, color, -1, cv2.LINE_AA)


def ring(picture: ByteArray, xy: Place, color: Color, radius: float) -> None:
    unit = unit_of(picture)
    size, width = round(radius * unit), max(1, round(LINE * unit))
    cv2.circle(picture, pixel(np.array(xy)), size, color, width, cv2.LINE_AA)


def tag(picture: ByteArray, text: str, xy: FloatArray, color: Color) -> None:
    """Dark text on a box of the color, centered at ``xy`` and kept inside the picture."""
    scale = TEXT * unit_of(picture)
    font, thick = cv2.FONT_HERSHEY_SIMPLEX, max(1, round(LINE * scale))
    (width, height), _ = cv2.getTextSize(text, font, scale, thick)
    margin = max(2, round(OUTLINE * scale))
    reach = np.array([width / 2 + margin, height / 2 + margin])
    center = np.clip(xy, reach, np.maximum(reach, np.array(picture.shape[1::-1]) - 1 - reach))
    low, high = pixel(center - reach), pixel(center + reach)
    cv2.rectangle(picture, low, high, color, -1)
    cv2.rectangle(picture, low, high, DARK, 1)
    place = (low[0] + margin, high[1] - margin)
    cv2.putText(picture, text, place, font, scale, DARK, thick, cv2.LINE_AA)


def question_mark(picture: ByteArray, crossing_xy: Place) -> None:
    tag(picture, "?", np.array(crossing_xy) + _ASIDE * unit_of(picture), WHITE)


def pixel(xy: FloatArray) -> tuple[int, int]:
    x, y = np.rint(xy).astype(int).tolist()
    return x, y


def steps_to(picture: ByteArray, longest: int | None) -> int:
    """By which whole number a picture is reduced so that no side is above ``longest``."""
    return 1 if longest is None else -(-max(picture.shape[:2]) // longest)


def smaller(picture: ByteArray, steps: int, how: int = cv2.INTER_AREA) -> ByteArray:
    """A picture reduced by a whole number, which is several times faster than by any other; a rest
    at the right and lower border is cut off."""
    height, width = (max(1, side // steps) for side in picture.shape[:2])
    part = picture[: height * steps, : width * steps]
    return np.asarray(cv2.resize(part, (width, height), interpolation=how), np.uint8)
