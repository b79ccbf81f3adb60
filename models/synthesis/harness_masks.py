"""The mask of a synthetic harness, with what real masks have: connectors, clips, tape, gaps, coarse
outlines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.geometry.polylines import arc_lengths, point_at
from models.synthesis.harness import FREE, Harness, TrueSection

_OVERSAMPLING = 2


@dataclass(frozen=True)
class MaskParams:
    """How often a scene has each disturbance (0 to 1); ``rough``: spread of the outline in px."""

    connectors: float = 0.35
    clips: float = 0.35
    tape: float = 0.3
    gaps: float = 0.45
    specks: float = 0.2
    coarse: float = 0.3
    rough: float = 0.8


PLAIN = MaskParams(0, 0, 0, 0, 0, 0, 0)
"""A mask without any disturbance."""


def draw_mask(harness: Harness, rng: np.random.Generator, params: MaskParams) -> BoolArray:
    """``(H, W)`` bool."""
    height, across = harness.size
    canvas = np.zeros((_OVERSAMPLING * height, _OVERSAMPLING * across), np.uint8)
    for section in harness.sections:
        _draw_section(canvas, section, rng, params)
    if rng.random() < params.connectors:
        _draw_connectors(canvas, harness, rng)
    if rng.random() < params.clips:
        for _ in range(int(rng.integers(1, 6))):
            _draw_clip(canvas, harness, rng)
    if rng.random() < params.gaps:
        for _ in range(int(rng.integers(1, 4))):
            _cut_gap(canvas, harness, rng)
    if rng.random() < params.specks:
        for _ in range(int(rng.integers(1, 4))):
            _draw_speck(canvas, rng)
    return _sampled(canvas, rng, params)


def _draw_section(
    canvas: ByteArray, section: TrueSection, rng: np.random.Generator, params: MaskParams
) -> None:
    count = len(section.xy)
    knots = max(2, count // 12)
    swell = np.interp(
        np.linspace(0, 1, count), np.linspace(0, 1, knots), rng.normal(0, 0.05, knots)
    )
    widths = section.width * (1 + (swell if params.rough else 0.0 * swell))
    if rng.random() < params.tape:
        for _ in range(int(rng.integers(1, 4))):
            at, reach = rng.integers(count), rng.integers(2, 6)
            widths[max(0, at - reach) : at + reach] *= rng.uniform(1.1, 1.45)
    for k in range(count - 1):
        _stroke(canvas, section.xy[k : k + 2], float(widths[k]))


def _stroke(canvas: ByteArray, points: FloatArray, width: float, value: int = 255) -> None:
    fixed = np.rint(((points + 0.5) * _OVERSAMPLING - 0.5) * 16).astype(np.int32)
    cv2.polylines(
        canvas, [fixed], False, value, max(1, round(width * _OVERSAMPLING)), cv2.LINE_8, 4
    )


def _box(
    canvas: ByteArray, center: FloatArray, angle: float, size: tuple[float, float], value: int = 255
) -> None:
    """A filled rectangle, ``size`` along and across ``angle``."""
    middle = (center + 0.5) * _OVERSAMPLING - 0.5
    sides = (size[0] * _OVERSAMPLING, size[1] * _OVERSAMPLING)
    corners = cv2.boxPoints(((float(middle[0]), float(middle[1])), sides, float(np.rad2deg(angle))))
    cv2.fillPoly(canvas, [np.rint(corners).astype(np.int32)], value)


def _draw_connectors(canvas: ByteArray, harness: Harness, rng: np.random.Generator) -> None:
    """Housings at free ends, where there is room: one that lies on another section would look like
    a joint."""
    for k, section in enumerate(harness.sections):
        others = np.concatenate(
            [np.zeros((0, 2)), *(s.xy for i, s in enumerate(harness.sections) if i != k)]
        )
        for end, inner, kind in ((0, 3, section.ends[0]), (-1, -4, section.ends[1])):
            if kind != FREE or rng.random() > 0.6:
                continue
            step = section.xy[end] - section.xy[inner]
            size = section.width * rng.uniform(1.5, 4.0), section.width * rng.uniform(1.4, 2.8)
            angle = float(np.arctan2(step[1], step[0]))
            center = section.xy[end] + 0.4 * size[0] * np.array([np.cos(angle), np.sin(angle)])
            away = np.hypot(*(others - center).T).min(initial=np.inf)
            if away > max(size) + section.width:
                _box(canvas, center, angle + rng.normal(0, 0.1), size)


def _place(harness: Harness, rng: np.random.Generator) -> tuple[TrueSection, FloatArray, float]:
    """A section, a point on it away from branch-points and crossings where possible, and its
    heading there."""
    special = np.concatenate((harness.branch_xy, *(m.xy[None] for m in harness.crossings)))
    for _ in range(8):
        section = harness.sections[int(rng.integers(len(harness.sections)))]
        k = int(rng.integers(1, len(section.xy) - 1))
        if not len(special) or np.hypot(*(special - section.xy[k]).T).min() > 2.5 * section.width:
            break
    step = section.xy[k + 1] - section.xy[k - 1]
    return section, section.xy[k], float(np.arctan2(step[1], step[0]))


def _draw_clip(canvas: ByteArray, harness: Harness, rng: np.random.Generator) -> None:
    """A clip or the tail of a cable tie: it sticks out by at most about a width and is no
    section."""
    section, xy, angle = _place(harness, rng)
    out = section.width * rng.uniform(0.3, 1.1) + 2
    side = rng.choice([-1, 1]) * (np.pi / 2 + rng.normal(0, 0.2))
    ahead = np.array([np.cos(angle + side), np.sin(angle + side)])
    size = (section.width / 2 + out, max(2.0, section.width * rng.uniform(0.2, 0.9)))
    _box(canvas, xy + ahead * size[0] / 2, angle + side, size)


def _cut_gap(canvas: ByteArray, harness: Harness, rng: np.random.Generator) -> None:
    """A piece of a section is missing: anywhere, or right beside a crossing, where the upper one
    casts shadow."""
    if harness.crossings and rng.random() < 0.55:
        which = int(rng.integers(len(harness.crossings)))
        m = harness.crossings[which]
        low, high, at_low = (m.b, m.a, m.at_b) if harness.a_over[which] else (m.a, m.b, m.at_a)
        lower, upper = harness.sections[low], harness.sections[high]
        lengths = arc_lengths(lower.xy)
        missing = lower.width * rng.uniform(0.2, 1.1) + 1
        away = upper.width / 2 / m.sine + missing / 2 + lower.width * rng.uniform(-0.1, 0.3)
        at = np.array([at_low + rng.choice([-1, 1]) * away])
        xy, ahead = point_at(lower.xy, lengths, np.concatenate((at, at + 3)))
        if np.allclose(xy, ahead):
            return
        _box(canvas, xy, float(np.arctan2(*(ahead - xy)[::-1])), (missing, 1.3 * lower.width), 0)
        return
    section, xy, angle = _place(harness, rng)
    _box(canvas, xy, angle, (section.width * rng.uniform(0.2, 1.2) + 1, 1.4 * section.width), 0)


def _draw_speck(canvas: ByteArray, rng: np.random.Generator) -> None:
    height, across = canvas.shape
    center = (int(rng.integers(across)), int(rng.integers(height)))
    axes = (int(rng.integers(2, 14)), int(rng.integers(2, 10)))
    cv2.ellipse(canvas, center, axes, float(rng.uniform(0, 180)), 0, 360, 255, -1)


def _sampled(canvas: ByteArray, rng: np.random.Generator, params: MaskParams) -> BoolArray:
    """The mask at its own size; the outline uneven, or in blocks as from a coarse sensor."""
    height, across = canvas.shape[0] // _OVERSAMPLING, canvas.shape[1] // _OVERSAMPLING
    share: NDArray[Any] = (
        cv2.resize(canvas, (across, height), interpolation=cv2.INTER_AREA).astype(np.float32) / 255
    )
    if params.rough:
        spread = rng.uniform(0, params.rough)
        noise = cv2.GaussianBlur(rng.normal(0, 1, share.shape).astype(np.float32), (0, 0), 2.0)
        soft = cv2.GaussianBlur(share, (0, 0), 0.5 + spread)
        share = soft + noise / max(float(noise.std()), 1e-6) * 0.18 * spread
    if rng.random() < params.coarse:
        block = int(rng.integers(2, 4))
        small = cv2.resize(share, (across // block, height // block), interpolation=cv2.INTER_AREA)
        share = cv2.resize(small, (across, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(share >= 0.5)
