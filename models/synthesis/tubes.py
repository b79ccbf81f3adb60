"""Cables as swept tubes in meters above the table: resting heights, rings of vertices,
triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.synthesis.curves import FloatArray
from models.synthesis.stacking import Stack


@dataclass(frozen=True)
class Tube:
    """V vertices and T triangles: ``vertices`` (V, 3), ``normals`` (V, 3), ``uv`` (V, 2) around and
    along, 0 to 1, ``faces`` (T, 3)."""

    vertices: FloatArray
    normals: FloatArray
    uv: FloatArray
    faces: NDArray[np.uint32]


def resting_heights(plan: Stack, half_widths: Sequence[float]) -> list[FloatArray]:
    """Height of each centerline above the table (m,), px: a strand lies on the table, and at a
    crossing on the strands below it, in the painting order of ``plan``."""
    lift = [half_widths[p.cable] for p in plan.pieces]
    passes: list[list[tuple[int, int]]] = [[] for _ in half_widths]  # per cable: sample and piece
    under: list[list[int]] = [[] for _ in plan.pieces]
    for meeting in plan.meetings:
        over, below = plan.over_and_under(meeting)
        for cable, sample in (over, below):
            passes[cable].append((sample, plan.rank(cable, sample)))
        under[plan.rank(*over)].append(plan.rank(*below))
    for k, piece in enumerate(plan.pieces):
        for j in under[k]:
            clear = 1.1 * (half_widths[piece.cable] + half_widths[plan.pieces[j].cable])
            lift[k] = max(lift[k], lift[j] + clear)
    return [
        _bridged(len(z), [(s, lift[k]) for s, k in here], half)
        for z, here, half in zip(plan.heights, passes, half_widths, strict=True)
    ]


def sweep(curve: FloatArray, radius: FloatArray, sides: int = 16) -> Tube:
    """``curve`` (m, 3) and ``radius`` (m,) in the same unit; the tube's ends are closed by a
    point."""
    tangent = np.gradient(curve, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    side = np.cross(tangent, (0.0, 0.0, 1.0))
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-12)
    upward = np.cross(side, tangent)
    angle = np.linspace(-np.pi, np.pi, sides + 1)  # the seam lies below
    normal = side[:, None] * np.sin(angle)[:, None] + upward[:, None] * np.cos(angle)[:, None]
    closing = np.concatenate([[0.0], np.ones(len(curve) - 2), [0.0]]) * radius
    vertices = curve[:, None] + normal * closing[:, None, None]
    u, v = np.meshgrid(np.linspace(0, 1, sides + 1), np.linspace(0, 1, len(curve)))
    flat = [
        np.ascontiguousarray(a.reshape(-1, a.shape[-1]), np.float32)
        for a in (vertices, normal, np.dstack([u, v]))
    ]
    return Tube(flat[0], flat[1], flat[2], _ring_faces(len(curve), sides))


def _ring_faces(rings: int, sides: int) -> NDArray[np.uint32]:
    """Two triangles between every pair of neighbors on neighboring rings of ``sides`` + 1
    vertices."""
    a = (np.arange(rings - 1)[:, None] * (sides + 1) + np.arange(sides)).ravel()
    b = a + sides + 1
    return np.concatenate([np.stack([a, a + 1, b], 1), np.stack([a + 1, b + 1, b], 1)]).astype(
        np.uint32
    )


def _bridged(samples: int, passes: Sequence[tuple[int, float]], half: float) -> FloatArray:
    """On the table (``half``) except around ``passes`` (sample, height), with ramps a few widths
    long."""
    wanted = np.full(samples, half)
    flat, ramp = int(4 * half) + 1, int(12 * half) + 1  # in samples of 0.7 px
    at = np.arange(samples)
    for sample, height in passes:
        beside = np.clip((np.abs(at - sample) - flat) / ramp, 0, 1)
        wanted = np.maximum(wanted, half + (height - half) * (0.5 + 0.5 * np.cos(np.pi * beside)))
    return wanted.astype(np.float32)
