"""What networks take for cables in workshops: springs, arrows, ruled mats, grilles, drag chains,
handles, table edges, shadows whose cable is elsewhere."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import NDArray

from models.synthesis.cables import paint_thing, soft_cover
from models.synthesis.canvas import Canvas
from models.synthesis.curves import axes, interpolate, random_curve
from models.synthesis.looks import (
    Color,
    Look,
    flat_look,
    random_color,
    random_gray,
    random_light,
    random_look,
)
from models.synthesis.ribbons import STEP_PX, strand

Rng = np.random.Generator


def spring(canvas: Canvas, rng: Rng) -> None:
    """A coil of wire seen from the side."""
    w = canvas.width
    wire, radius = rng.uniform(0.002, 0.006) * w, rng.uniform(0.008, 0.04) * w
    turns, pitch = int(rng.integers(4, 18)), rng.uniform(2.2, 5.0) * wire
    phase = np.linspace(0, 2 * np.pi * turns, 14 * turns)
    along, across = axes(rng.uniform(-np.pi, np.pi))
    at = rng.uniform((0, 0), (w, canvas.height))
    xy = (
        at
        + (phase / (2 * np.pi) * pitch)[:, None] * along
        + (radius * np.cos(phase))[:, None] * across
    )
    xy = xy + (0.35 * pitch * np.sin(phase))[:, None] * along
    _tube(canvas, rng, xy, wire, random_gray(rng, 0.3, 0.95))


def arrow(canvas: Canvas, rng: Rng) -> None:
    """An arrow or a frame that somebody drew into the photograph."""
    w = canvas.width
    color, half = random_color(rng), rng.uniform(0.002, 0.008) * w
    start, heading = rng.uniform((0, 0), (w, canvas.height)), rng.uniform(-np.pi, np.pi)
    along, across = axes(heading)
    length = rng.uniform(0.08, 0.4) * w
    tip, wide = start + along * length, rng.uniform(2.5, 5.0) * half
    if rng.random() < 0.3:
        side = rng.uniform(0.1, 0.3) * w
        corners = start + side * np.array([(0, 0), (1, 0), (1, 0.6), (0, 0.6), (0, 0)])
        for a, b in pairwise(corners):
            middle, leg = (a + b) / 2, b - a
            canvas.box(
                middle, (np.hypot(*leg) / 2 + half, half), float(np.arctan2(leg[1], leg[0])), color
            )
        return
    canvas.box((start + tip) / 2, (length / 2, half), heading, color)
    canvas.polygon([tip + along * 1.8 * wide, tip + across * wide, tip - across * wide], color)


def ruled_mat(canvas: Canvas, rng: Rng) -> None:
    """A cutting mat or ruled paper: thin lines in both directions, every fifth one thicker, some
    rays at 30, 45 or 60 degrees."""
    w = canvas.width
    pitch, angle = rng.uniform(0.012, 0.08) * w, rng.normal(0, 0.6)
    center = rng.uniform((0, 0), (w, canvas.height))
    count = int(np.ceil(2.2 * w / pitch))
    if rng.random() < 0.6:
        ground = random_color(rng) if rng.random() < 0.6 else random_gray(rng)
        canvas.box(center, rng.uniform((0.3 * w, 0.3 * w), (2 * w, 2 * w)), angle, ground)
    line, opacity = random_gray(rng, 0.0, 1.0), rng.uniform(0.3, 1.0)
    thin = max(rng.uniform(0.0008, 0.0025) * w, 0.4)
    for step, half in ((1, thin), (5, 1.7 * thin)):
        for turn in (angle, angle + np.pi / 2)[: 1 if rng.random() < 0.25 else 2]:
            across = axes(turn)[1]
            for k in range(-count // 2, count // 2 + 1, step):
                canvas.box(center + across * k * pitch, (2 * w, half), turn, line, opacity=opacity)
    for degrees in rng.choice([30, 45, 60, 120, 135, 150], rng.integers(0, 4), replace=False):
        corner = center + pitch * 5 * rng.integers(-2, 3, 2)
        canvas.box(corner, (2 * w, 1.2 * thin), angle + np.deg2rad(degrees), line, opacity=opacity)


def grille(canvas: Canvas, rng: Rng) -> None:
    """The wire guard of a fan: rings about a hub and spokes."""
    w = canvas.width
    at, outer = rng.uniform((0, 0), (w, canvas.height)), rng.uniform(0.06, 0.25) * w
    wire, color = max(rng.uniform(0.0015, 0.006) * w, 0.8), random_gray(rng)
    if rng.random() < 0.7:
        canvas.disc(at, 1.05 * outer, random_gray(rng, 0.0, 0.3))
    turn = np.linspace(0, 2 * np.pi, 60)
    for radius in np.linspace(0.3, 1.0, int(rng.integers(3, 8))) * outer:
        _tube(canvas, rng, at + radius * np.column_stack([np.cos(turn), np.sin(turn)]), wire, color)
    for angle in rng.uniform(0, np.pi) + np.arange(int(rng.integers(2, 5))) * np.pi / 2:
        _tube(
            canvas,
            rng,
            at + np.linspace(0.25, 1.0, 8)[:, None] * outer * axes(float(angle))[0],
            wire,
            color,
        )


def drag_chain(canvas: Canvas, rng: Rng) -> None:
    """Links of an energy chain, one behind the other along a bend."""
    w = canvas.width
    half = rng.uniform(0.015, 0.05) * w
    curve = random_curve(rng, canvas.size, 2 * half)
    pitch, tone = half * rng.uniform(0.7, 1.6), random_gray(rng, 0.02, 0.35)
    samples = range(0, len(curve) - 3, max(int(pitch / STEP_PX), 1))
    for k in samples:
        leg = curve[k + 3, :2] - curve[k, :2]
        heading = float(np.arctan2(leg[1], leg[0]))
        canvas.box(
            curve[k, :2],
            (0.52 * pitch, half),
            heading,
            tone,
            corner=0.2 * half,
            bevel=rng.uniform(-0.5, -0.2),
        )
        canvas.box(curve[k, :2], (0.15 * pitch, 0.8 * half), heading, (0, 0, 0), opacity=0.6)


def handle(canvas: Canvas, rng: Rng) -> None:
    """A thick bowed grip whose two ends stand on a plate."""
    w = canvas.width
    at, heading = rng.uniform((0, 0), (w, canvas.height)), rng.uniform(-np.pi, np.pi)
    along, across = axes(heading)
    span, rise, half = (
        rng.uniform(0.06, 0.25) * w,
        rng.uniform(0.03, 0.12) * w,
        rng.uniform(0.006, 0.03) * w,
    )
    t = np.linspace(-1, 1, 24)[:, None]
    color = random_gray(rng) if rng.random() < 0.5 else random_color(rng)
    if rng.random() < 0.6:
        canvas.box(
            at, (1.3 * span, rng.uniform(0.5, 2.5) * half), heading, random_gray(rng), bevel=0.3
        )
    flat = rng.uniform(2.0, 6.0)  # 2 is an arch, more a bar with two feet
    _tube(canvas, rng, at + along * span * t + across * rise * (1 - np.abs(t) ** flat), half, color)


def table_edge(canvas: Canvas, rng: Rng) -> None:
    """The ground ends: beyond a straight edge another surface, with a bright rim and a shadow
    below."""
    w = canvas.width
    at, angle = (
        rng.uniform((0.1 * w, 0.1 * canvas.height), (0.9 * w, 0.9 * canvas.height)),
        rng.uniform(-np.pi, np.pi),
    )
    across = axes(angle)[1]
    rim = rng.uniform(0.002, 0.02) * w
    canvas.box(
        at + across * 2 * w, (3 * w, 2 * w), angle, random_gray(rng), opacity=rng.uniform(0.5, 1.0)
    )
    canvas.box(
        at + across * 1.5 * rim, (3 * w, 2.5 * rim), angle, (0, 0, 0), opacity=rng.uniform(0.0, 0.6)
    )
    canvas.box(
        at,
        (3 * w, rim),
        angle,
        random_gray(rng),
        bevel=rng.uniform(-0.6, 0.6),
        opacity=rng.uniform(0.4, 1.0),
    )


def stray_shadow(canvas: Canvas, rng: Rng) -> None:
    """The shadow of a cable that hangs outside the picture or far above the ground."""
    half = rng.uniform(0.004, 0.03) * canvas.width
    curve = random_curve(rng, canvas.size, 2 * half)
    whole = strand(curve, np.full(len(curve), half, np.float32), canvas.rgb.device)
    canvas.darken(
        soft_cover(canvas, [whole], round(half * rng.uniform(0.3, 2.5) + 1)),
        rng.uniform(0.15, 0.65),
    )


LOOKALIKES = (spring, arrow, ruled_mat, grille, drag_chain, handle, table_edge, stray_shadow)


def _tube(
    canvas: Canvas, rng: Rng, points: NDArray[np.floating], half: float, color: Color
) -> None:
    """A smooth round bar through ``points`` (n, 2), ``half`` px thick on either side."""
    flat = np.concatenate([points, np.zeros((len(points), 1))], 1).astype(np.float32)
    curve = interpolate(flat, STEP_PX)
    look: Look = flat_look(color)
    if rng.random() < 0.8:
        look = replace(random_look(rng, color, 2 * half), pattern="plain", opacity=1.0)
    light = random_light(rng)
    paint_thing(canvas, curve, np.full(len(curve), half, np.float32), look, light, rng)


def dark_boxes(canvas: Canvas, rng: Rng) -> None:
    """Controllers and relays: black bodies with rims and sockets, among which black cables are hard
    to see."""
    w = canvas.width
    for _ in range(rng.integers(1, 4)):
        at, half = (
            rng.uniform((0, 0), (w, canvas.height)),
            rng.uniform((0.08 * w, 0.06 * w), (0.35 * w, 0.3 * w)),
        )
        angle, tone = rng.normal(0, 0.3), rng.uniform(0.01, 0.16)
        body = tuple(float(v) for v in np.clip(tone + rng.normal(0, 0.01, 3), 0, 1))
        canvas.box(
            at, half, angle, body, corner=rng.uniform(0, 0.02) * w, bevel=rng.uniform(-0.4, 0.4)
        )
        for _ in range(rng.integers(0, 6)):
            part, tint = (
                at + rng.uniform(-0.9, 0.9, 2) * half,
                torch.full((3,), tone * rng.uniform(0.3, 2.5)),
            )
            canvas.box(
                part, rng.uniform(0.005 * w, 0.06 * w, 2), angle, tint, bevel=rng.uniform(-0.4, 0.4)
            )
