"""Where a cable goes on that the foreground lost: from a free end to the border or to another
strand.

A network that sees half of a cable is often sure that there is none from some place on, without a
second opinion at its edge. The picture has one: the strip of color between two edges goes on.

Strategy: along the last widths of an instance its color is known. From a free end a few paths at a
time are led on in steps of a third of a width, each turning a little; what counts is how near the
color across the strip stays to the instance's own, against its distance from the ground on both
sides. A path that leads to the picture's border or to other foreground is the rest of the cable.
One that is lost on the way is none: cables do not end nowhere, shadows and scratches do. A strand
that it meets at once covers it: it goes on at the other side.

Symbols: B paths, K turns, T positions across, n points.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import compress
from typing import NamedTuple

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.colors import LAB_OF_A_LEVEL
from models.geometry.directions import quarter_turned, unit
from models.geometry.painting import stroke
from models.geometry.polylines import arc_lengths, point_at
from models.geometry.sampling import read_nearest
from models.instances.lookalikes import IN_COMPANY
from models.instances.scene import Instance, Scene
from models.strands.ends import within

_ACROSS = np.linspace(-1.3, 1.3, 27)
"""Positions across the strip, in widths."""
_CORE, _LEFT, _RIGHT = (
    slice(*np.flatnonzero(np.abs(_ACROSS - middle) <= reach)[[0, -1]] + (0, 1))
    for middle, reach in ((0.0, 0.32), (-0.93, 0.22), (0.93, 0.22))
)
"""Of these positions the cable's core and the ground on both sides; slices, which read without a
copy."""
_LONGEST_PX = 960
"""A larger picture is followed at this size."""
_SMOOTHING_PX = 0.8
_FORGETTING = 0.03
"""Share of a path's color that each step renews: light changes along a cable."""


@dataclass(frozen=True)
class ContinuationParams:
    """Lengths in widths. ``least_chance`` that the instance is a cable, ``in_company`` of one that
    likely is, and ``certainty`` of the foreground along it; ``least_length`` of the instance,
    ``least_width_px`` of it. ``known``: what its color is read from, behind the end. ``turn_deg``:
    most of a step. ``near``: most distance from the color, over that from the ground, which is at
    least ``contrast`` (CIELAB). ``gap`` that may look different, ``good`` share of the steps that
    may not; a continuation is at most ``longest``; of that at most ``covered`` is under others, and
    the rest is at least ``shortest``. ``turned``: most of all together, radians."""

    least_chance: float = 0.5
    in_company: float = IN_COMPANY
    certainty: float = 0.9
    least_length: float = 6.0
    least_width_px: float = 2.0
    known: tuple[float, float] = (1.0, 9.0)
    turn_deg: float = 18.0
    turns: int = 9
    paths: int = 6
    near: float = 0.42
    contrast: float = 5.0
    gap: float = 1.5
    good: float = 0.85
    shortest: float = 2.0
    longest: float = 25.0
    turned: float = 3.6
    covered: float = 5.0


class _Tip(NamedTuple):
    """The end of a strip: ``xy`` (2,) a width behind it, ``angle`` it goes on in, ``width``,
    ``color`` (3,) and its ``spread``."""

    xy: FloatArray
    angle: float
    width: float
    color: FloatArray
    spread: float


class _Paths(NamedTuple):
    """``xy`` (B, n, 2) so far, ``good`` (B, n) which points look like the cable, ``under`` (B, n)
    which are on other foreground; ``angle`` (B,) and ``cost`` (B,) at the last point, ``color`` (B,
    3) there, ``lost`` (B,) px since the last good one."""

    xy: FloatArray
    good: BoolArray
    under: BoolArray
    angle: FloatArray
    cost: FloatArray
    color: FloatArray
    lost: FloatArray


class _Strip(NamedTuple):
    """``color`` (…, 3) of the core and its ``spread``; ``contrast`` and ``mean_contrast`` (…) to
    the ground on the less different side, and of both."""

    color: FloatArray
    spread: FloatArray
    contrast: FloatArray
    mean_contrast: FloatArray


def continued(
    scene: Scene,
    chances: FloatArray,
    probability: Float32Array,
    cable: BoolArray,
    image: ByteArray,
    params: ContinuationParams | None = None,
) -> BoolArray:
    """(H, W) what ``cable`` (H, W) lacks of the instances of a scene; ``chances`` (I,) that each is
    a cable."""
    settings = params or ContinuationParams()
    scale = min(1.0, _LONGEST_PX / max(cable.shape))
    size = tuple(max(1, round(scale * side)) for side in cable.shape[::-1])
    drawn = np.zeros(size[::-1], np.uint8)
    foreground, lab = _resized(cable.view(np.uint8), size) > 0, None
    likely = bool((chances >= settings.least_chance).any())
    enough = chances >= (settings.in_company if likely else settings.least_chance)
    for instance in compress(scene.instances, enough):
        if not _whole_enough(instance, scale, probability, settings):
            continue
        for line in _free_ends(instance, scale):
            if not within(line[0], foreground.shape, 1.2 * instance.width_px * scale + 2):
                continue  # at the border there is nothing to follow
            lab = _colors(_resized(image, size)) if lab is None else lab
            tip = _tip(line, instance.width_px * scale, lab, settings)
            path = None if tip is None else _followed(tip, lab, foreground, settings)
            if tip is not None and path is not None:
                stroke(drawn, path, 1, tip.width)
    return np.asarray((_resized(drawn, cable.shape[::-1], cv2.INTER_NEAREST) > 0) & ~cable)


def _resized(picture: ByteArray, size: tuple[int, ...], how: int = cv2.INTER_AREA) -> ByteArray:
    if picture.shape[1::-1] == size:
        return picture
    return np.asarray(cv2.resize(picture, size, interpolation=how), np.uint8)


def _colors(image: ByteArray) -> ByteArray:
    """CIELAB in 8 bits, as OpenCV has it."""
    return np.asarray(
        cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2LAB), (0, 0), _SMOOTHING_PX), np.uint8
    )


def _whole_enough(
    instance: Instance, scale: float, probability: Float32Array, params: ContinuationParams
) -> bool:
    width = instance.width_px
    if width * scale < params.least_width_px:
        return False
    if instance.closed or instance.length_px < params.least_length * width:
        return False
    return float(np.median(read_nearest(probability, instance.centerline_xy))) >= params.certainty


def _free_ends(instance: Instance, scale: float) -> list[FloatArray]:
    """(n, 2) centerlines at the reduced size, each from a free end inward."""
    line = (instance.centerline_xy + 0.5) * scale - 0.5
    ends = zip(instance.endpoints, (line, line[::-1]), strict=True)
    return [points for endpoint, points in ends if endpoint.kind == "free"]


def _tip(line: FloatArray, width: float, lab: ByteArray, params: ContinuationParams) -> _Tip | None:
    """None where the strip does not stand out of the ground."""
    arc = arc_lengths(line)
    places = np.arange(params.known[0] * width, min(params.known[1] * width, float(arc[-1])), 1.0)
    if len(places) < 6:
        return None
    at, ahead, behind = (point_at(line, arc, places + shift * width) for shift in (0.0, -1.0, 1.0))
    strips = _strips(lab, at, unit(ahead - behind), width)
    if np.median(strips.contrast) < params.contrast:
        return None
    step = at[0] - point_at(line, arc, np.array([4.0 * width]))[0]
    near = max(3, len(places) // 3)
    angle = float(np.arctan2(step[1], step[0]))
    return _Tip(
        at[0], angle, width, strips.color[:near].mean(axis=0), float(np.median(strips.spread))
    )


def _strips(lab: ByteArray, xy: FloatArray, direction: FloatArray, width: float) -> _Strip:
    """What is across (…, 2) points in a ``direction`` (…, 2)."""
    at = xy[..., None, :] + (width * _ACROSS)[:, None] * quarter_turned(direction)[..., None, :]
    x, y = (at[..., axis].reshape(-1, len(_ACROSS)).astype(np.float32) for axis in (0, 1))
    read = cv2.remap(lab, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    read = read.reshape(*at.shape[:-1], 3) * LAB_OF_A_LEVEL
    color = read[..., _CORE, :].mean(axis=-2)
    spread = _length(read[..., _CORE, :] - color[..., None, :]).mean(axis=-1)
    left, right = (_length(read[..., side, :].mean(axis=-2) - color) for side in (_LEFT, _RIGHT))
    return _Strip(color, spread, np.minimum(left, right), (left + right) / 2)


def _length(vectors: FloatArray) -> FloatArray:
    """(…,) of (…, d)."""
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))


def _followed(
    tip: _Tip, lab: ByteArray, foreground: BoolArray, params: ContinuationParams
) -> FloatArray | None:
    """(n, 2) from a width behind the tip to the border or to other foreground; None where it leads
    nowhere."""
    step = max(1.5, tip.width / 3)
    none, start = np.zeros((1, 1), bool), np.full(1, tip.angle)
    paths = _Paths(
        tip.xy[None, None], ~none, none, start, np.zeros(1), tip.color[None], np.zeros(1)
    )
    own, nothing = 1.5 * tip.width, np.zeros_like(foreground)
    for taken in range(1, int((params.longest + 1) * tip.width / step) + 1):
        other = foreground if taken * step > own else nothing
        paths = _led_on(paths, tip, step, lab, other, params)
        if not len(paths.cost):
            return None
        first = _Path(paths.xy[0], paths.good[0], paths.under[0])
        gone = not within(first.xy[-1], foreground.shape, tip.width / 2)
        if gone or (first.under[-1] and first.seen() * step >= (1 + params.shortest) * tip.width):
            return first.xy if _is_cable(first, tip.width, params) else None
    return None


class _Path(NamedTuple):
    """``xy`` (n, 2), ``good`` and ``under`` (n,): one of :class:`_Paths`."""

    xy: FloatArray
    good: BoolArray
    under: BoolArray

    def seen(self) -> int:
        """Steps that are on no other foreground."""
        return int(np.count_nonzero(~self.under[1:]))


def _is_cable(path: _Path, width: float, params: ContinuationParams) -> bool:
    steps = np.diff(path.xy, axis=0)
    turned = np.ptp(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0])))
    seen = ~path.under[1:]
    length = float(np.hypot(*steps[seen].T).sum())
    long_enough = length >= (1 + params.shortest) * width
    return bool(
        long_enough and path.good[1:][seen].mean() >= params.good and turned < params.turned
    )


def _led_on(
    paths: _Paths,
    tip: _Tip,
    step: float,
    lab: ByteArray,
    other: BoolArray,
    params: ContinuationParams,
) -> _Paths:
    """The cheapest of all paths with each turn; of several at one place in one direction only the
    first. Under ``other`` (H, W) foreground only turning costs."""
    most = np.deg2rad(params.turn_deg)
    turn = np.linspace(-most, most, params.turns)
    angle = paths.angle[:, None] + turn
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    xy = paths.xy[:, -1, None] + step * direction
    under = read_nearest(other, xy.reshape(-1, 2)).reshape(xy.shape[:2]) > 0
    strip = _strips(lab, xy, direction, tip.width)
    away = _length(strip.color - paths.color[:, None])
    good = (away < params.near * strip.contrast) & (strip.contrast > params.contrast)
    good &= strip.spread < 0.6 * np.maximum(strip.contrast, 1.0) + tip.spread
    good &= ~under
    look = np.minimum(away / np.clip(strip.mean_contrast, 3.0, 40.0), 3.0) + 0.6 * ~good
    look += 0.5 * np.maximum(strip.spread - 1.5 * tip.spread, 0.0) / np.maximum(strip.contrast, 3.0)
    cost = paths.cost[:, None] + 0.25 * (turn / most) ** 2 + np.where(under, 0.0, look)
    covered = step * (np.count_nonzero(paths.under, axis=1)[:, None] + under)
    lost = np.where(good, 0.0, paths.lost[:, None] + np.where(under, 0.0, step))
    lost[covered > params.covered * tip.width] = np.inf
    best = _distinct(xy, angle, cost, tip.width, params.paths)
    best = best[lost.ravel()[best] <= params.gap * tip.width]
    path, kept = np.unravel_index(best, cost.shape)
    color = paths.color[path]
    color = color + _FORGETTING * good[path, kept, None] * (strip.color[path, kept] - color)
    return _Paths(
        np.concatenate((paths.xy[path], xy[path, kept, None]), axis=1),
        np.concatenate((paths.good[path], good[path, kept, None]), axis=1),
        np.concatenate((paths.under[path], under[path, kept, None]), axis=1),
        angle[path, kept],
        cost[path, kept],
        color,
        lost[path, kept],
    )


def _distinct(
    xy: FloatArray, angle: FloatArray, cost: FloatArray, width: float, count: int
) -> IntArray:
    """At most ``count`` flat indices, cheapest first, one for each place and direction."""
    cells = np.column_stack(
        (xy.reshape(-1, 2) / max(1.0, width / 4), np.rad2deg(angle.ravel()) / 15.0)
    )
    of_cell: dict[tuple[int, ...], int] = {}
    named = np.floor(cells).astype(np.int64).tolist()
    for index in np.argsort(cost, axis=None, kind="stable").tolist():
        of_cell.setdefault(tuple(named[index]), index)
        if len(of_cell) == count:
            break
    return np.array(list(of_cell.values()), np.intp)
