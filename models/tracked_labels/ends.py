"""Where a DLO ends: along itself no crop corrects it, since a hand that marks its end too early is
still on it.

Strategy: near each end of a stroke the pictures are sampled along the corrected line and a little
past it. What the line looks like against the ground beside it is known from farther in, and what
ground looks like against ground from either side. Each sample then speaks for cable or for ground,
and the end is put where the samples of all views together change from one to the other: the hand's
error along the DLO is the same in all of them. A view may differ a little: what is left of the
calibration's error is its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.directions import quarter_turned, unit
from models.tracked_labels.correction import CorrectedStroke

_STEP = 0.125
"""Of the places that are looked at, in samples of the stroke."""


@dataclass(frozen=True)
class EndParams:
    """``reach``: samples of the stroke by which an end may be off, to either side; ``spread``: by
    how much it is off (standard deviation, samples), ``own`` by how much more in one view;
    ``most``: log evidence of one place in one view, at most; ``known``: samples farther in that
    tell what the DLO looks like."""

    reach: float = 4.0
    spread: float = 1.6
    own: float = 0.5
    most: float = 2.0
    known: int = 8


def settle_ends(
    images: Sequence[ByteArray],
    strokes: Sequence[CorrectedStroke],
    widths_px: Sequence[FloatArray],
    params: EndParams,
) -> list[CorrectedStroke]:
    """One stroke in all its views, with both its ends where the pictures show them; ``widths_px``
    (n,) in each view.

    A view that does not show an end has no say in it; it is moved as the others say.
    """
    out = list(strokes)
    for backwards in (False, True):
        views = [
            (image, _turned(s, backwards), w[::-1] if backwards else w)
            for image, s, w in zip(images, out, widths_px, strict=True)
        ]
        offsets = _offsets(views, params)
        out = [
            _turned(_moved(stroke, offset, params), backwards)
            for (_, stroke, _), offset in zip(views, offsets, strict=True)
        ]
    return out


def _offsets(
    views: Sequence[tuple[ByteArray, CorrectedStroke, FloatArray]], params: EndParams
) -> list[float]:
    """How many samples after (before: negative) its first sample the DLO begins, in each view."""
    places = np.arange(-params.reach, params.reach + _STEP / 2, _STEP)
    evidence = np.zeros((len(views), len(places)))
    for row, (image, stroke, widths) in zip(evidence, views, strict=True):
        if (
            np.isfinite(stroke.xy[: int(params.reach) + params.known]).all()
            and len(stroke.xy) > 2 * params.known
        ):
            row[:] = _evidence(
                image, stroke, float(np.mean(widths[: params.known])), places, params
            )
    # From each place on it is cable: the sum of all that follows.
    begins = np.cumsum(evidence[:, ::-1], axis=1)[:, ::-1] * _STEP
    common = places[(begins.sum(0) - places**2 / (2 * params.spread**2)).argmax()]
    single = places[(begins - (places - common) ** 2 / (2 * params.own**2)).argmax(1)]
    return [float(offset) for offset in single]


def _evidence(
    image: ByteArray, stroke: CorrectedStroke, width: float, places: FloatArray, params: EndParams
) -> FloatArray:
    """Log odds of cable against ground at each place; 0 outside the picture."""
    inner = params.reach + np.arange(0, params.known, _STEP)
    cable, ground = (
        _looks(image, stroke, inner, width, (0.0,)),
        _looks(image, stroke, inner, width, (-2.0, 2.0)),
    )
    seen = _looks(image, stroke, places, width, (0.0,))
    odds = np.asarray(_likelihood(seen, cable) - _likelihood(seen, ground))
    at = _along(stroke.xy, places)
    inside = ((at >= 0) & (at <= np.array(image.shape[1::-1]) - 1)).all(1)
    return np.where(inside, odds.clip(-params.most, params.most), 0.0)


def _looks(
    image: ByteArray,
    stroke: CorrectedStroke,
    places: FloatArray,
    width: float,
    shifts: Sequence[float],
) -> FloatArray:
    """(n · shifts, 3) color of the middle less that of both its sides, at places of the line moved
    by ``shifts`` widths across it."""
    at = _along(stroke.xy, places)
    normal = quarter_turned(
        unit(_along(stroke.xy, places + 0.25) - _along(stroke.xy, places - 0.25))
    )
    rows = []
    for shift in shifts:
        middle, left, right = (
            _colors(image, at, normal, (shift + np.asarray(part)) * width)
            for part in ((-0.25, 0.0, 0.25), (-1.2, -1.0, -0.8), (0.8, 1.0, 1.2))
        )
        rows.append(middle - (left + right) / 2)
    return np.concatenate(rows)


def _colors(image: ByteArray, at: FloatArray, normal: FloatArray, across: FloatArray) -> FloatArray:
    """(n, 3) mean color over points ``across`` (m,) px from (n, 2) places."""
    points = (at[:, None] + normal[:, None] * across[:, None]).astype(np.float32)
    seen = cv2.remap(
        image, points[..., 0], points[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(seen, np.float64).mean(1)


def _likelihood(seen: FloatArray, known: FloatArray) -> FloatArray:
    """(n,) log density of a normal distribution with the moments of ``known``."""
    center = known.mean(0)
    spread = np.cov(known.T) + 16.0 * np.eye(3)
    away = seen - center
    return np.asarray(
        -0.5
        * (
            np.einsum("ni,ij,nj->n", away, np.linalg.inv(spread), away)
            + np.linalg.slogdet(spread)[1]
        )
    )


def _along(values: FloatArray, places: FloatArray) -> FloatArray:
    """(m, ...) values at fractional samples; before the first one as the next three go on."""
    index = np.arange(len(values))
    columns = values.reshape(len(values), -1).T
    slope = (columns[:, 3] - columns[:, 0]) / 3
    inside = np.stack([np.interp(places, index, column) for column in columns], 1)
    out: FloatArray = inside + np.minimum(places, 0)[:, None] * slope
    return out.reshape(len(places), *values.shape[1:])


def _moved(stroke: CorrectedStroke, offset: float, params: EndParams) -> CorrectedStroke:
    """The stroke begins ``offset`` samples later; its first samples are spread anew, as many as
    before."""
    few = int(params.reach) + 3
    if len(stroke.xy) <= few or not np.isfinite(stroke.xy[: few + 1]).all():
        return stroke
    places = offset + (few - offset) * np.arange(few) / few

    def spread(values: FloatArray) -> FloatArray:
        return np.concatenate([_along(values, places), values[few:]])

    trust = np.concatenate(
        [np.interp(places, np.arange(len(stroke.trust)), stroke.trust), stroke.trust[few:]]
    )
    return CorrectedStroke(
        spread(stroke.xy),
        spread(stroke.offset_px),
        trust,
        spread(stroke.width_px),
        spread(stroke.depth_m),
    )


def _turned(stroke: CorrectedStroke, backwards: bool) -> CorrectedStroke:
    if not backwards:
        return stroke
    return replace(
        stroke,
        xy=stroke.xy[::-1],
        offset_px=stroke.offset_px[::-1],
        trust=stroke.trust[::-1],
        width_px=stroke.width_px[::-1],
        depth_m=stroke.depth_m[::-1],
    )
