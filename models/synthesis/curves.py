"""Random DLO shapes by iterative propagation (thesis section 2.4.1, eq. 2.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float32]


@dataclass(frozen=True)
class CurveParams:
    """How a control polygon grows: every step turns the heading a little, and the turning itself
    drifts.

    ``step_px`` bounds the propagation step s; ``turn_rad`` is the spread of the turning rate per
    step and ``wander_rad`` the spread of the noise on top of it (the "random direction pointing
    forward").
    """

    step_px: tuple[float, float]
    turn_rad: float
    wander_rad: float
    n_control: int
    height: tuple[float, float] = (0.0, 1.0)


def propagate(
    rng: np.random.Generator, start_xy: FloatArray, heading_rad: float, params: CurveParams
) -> FloatArray:
    """Control points (n, 3) x, y, z: ``p[t+1] = p[t] + s d``; z drifts within ``params.height``."""
    n = params.n_control
    rate = rng.normal(0.0, params.turn_rad)
    turns = rate * np.cumprod(np.full(n, 0.92)) + np.cumsum(
        rng.normal(0.0, 0.35 * params.turn_rad, n)
    )
    headings = heading_rad + np.cumsum(turns) + rng.normal(0.0, params.wander_rad, n)
    steps = rng.uniform(*params.step_px, n)[:, None] * np.stack(
        [np.cos(headings), np.sin(headings)], 1
    )
    xy = start_xy + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, 0)])[:n]
    low, high = params.height
    z = np.cumsum(rng.normal(0.0, 0.45 * (high - low), n)) + rng.uniform(low, high)
    z = low + (high - low) * np.abs((z - low) / (high - low) % 2.0 - 1.0)
    return np.concatenate([xy, z[:, None]], 1).astype(np.float32)


def interpolate(control: FloatArray, spacing: float) -> FloatArray:
    """Uniform cubic B-spline through ``control`` (n, d), sampled about every ``spacing`` units: (m,
    d)."""
    n = len(control)
    system = np.diag(np.full(n, 4.0)) + np.diag(np.ones(n - 1), 1) + np.diag(np.ones(n - 1), -1)
    system[0, :2] = system[-1, -1:-3:-1] = (6.0, 0.0)
    coefficients = np.linalg.solve(system / 6.0, control)
    ends = 2 * coefficients[[0, -1]] - coefficients[[1, -2]]
    padded = np.concatenate([ends[:1], coefficients, ends[1:]])
    chord = np.linalg.norm(np.diff(control[:, :2], axis=0), axis=1).sum()
    t = np.linspace(0.0, n - 1 - 1e-6, max(int(1.15 * chord / spacing), 2))
    k = t.astype(int)
    f = (t - k)[:, None]
    basis = ((1 - f) ** 3, 3 * f**3 - 6 * f**2 + 4, -3 * f**3 + 3 * f**2 + 3 * f + 1, f**3)
    return np.asarray(sum(b * padded[k + i] for i, b in enumerate(basis)) / 6.0, np.float32)


def random_curve(
    rng: np.random.Generator,
    size: tuple[int, int],
    width_px: float,
    *,
    start: tuple[NDArray[np.floating], float] | None = None,
    spacing: float = 0.7,
) -> FloatArray:
    """One DLO over a picture of ``size`` (height, width): (m, 3) dense points, from ``start`` (x, y
    and heading in rad), else from the border or from inside."""
    height, width = size
    step = rng.uniform(0.10, 0.28) * max(size)
    loopy = rng.random() < 0.3
    params = CurveParams(
        step_px=(0.7 * step, 1.3 * step),
        turn_rad=rng.uniform(0.35, 0.75) if loopy else rng.uniform(0.02, 0.3),
        wander_rad=rng.uniform(0.0, 0.15),
        n_control=int(np.clip(rng.uniform(0.5, 2.6) * max(size) / step, 4, 26)),
    )
    # The bend radius of a real cable is a few times its own width.
    step_floor = 3.0 * width_px
    if step < step_floor:
        params = CurveParams(
            (step_floor, 1.4 * step_floor), params.turn_rad, params.wander_rad, params.n_control
        )
    if start is None and rng.random() < 0.65:
        start = _from_border(rng, height, width, width_px)
    elif start is None:
        start = (
            rng.uniform((0.05 * width, 0.05 * height), (0.95 * width, 0.95 * height)),
            rng.uniform(-np.pi, np.pi),
        )
    return interpolate(propagate(rng, start[0].astype(np.float32), start[1], params), spacing)


def parallel_curve(
    rng: np.random.Generator,
    curve: FloatArray,
    gap_px: float | NDArray[np.floating],
    stray: float = 0.25,
) -> FloatArray:
    """A neighbor that runs beside ``curve`` at about ``gap_px`` (one value or (m,)) and strays from
    it by ``stray`` of the gap: (m, 3)."""
    typical = float(np.abs(gap_px).mean())
    drift = interpolate(rng.normal(0.0, stray * typical, (6, 1)).astype(np.float32), 1.0)
    wave = np.interp(np.linspace(0, 1, len(curve)), np.linspace(0, 1, len(drift)), drift[:, 0])
    beside = curve.copy()
    beside[:, :2] += normals(curve) * (np.asarray(gap_px) + wave)[:, None]
    beside[:, 2] = np.clip(curve[:, 2] + rng.normal(0.0, 0.15), 0.0, 1.0)
    return beside.astype(np.float32)


def coil(
    rng: np.random.Generator, size: tuple[int, int], width_px: float, spacing: float = 0.7
) -> FloatArray:
    """A cable wound up in two to five turns of drifting center and radius, with both ends leading
    away: (m, 3)."""
    turns = rng.uniform(1.5, 4.5)
    steps = int(turns * 14)
    radius = max(rng.uniform(0.12, 0.35) * min(size), 3.0 * width_px) * (
        1 + rng.normal(0, 0.04, steps)
    )
    angle = rng.uniform(-np.pi, np.pi) + rng.choice([-1, 1]) * np.linspace(
        0, turns * 2 * np.pi, steps
    )
    center = np.array([rng.uniform(0.2, 0.8) * size[1], rng.uniform(0.2, 0.8) * size[0]])
    drift = np.cumsum(rng.normal(0, 0.12 * width_px, (steps, 2)), 0)
    ring = (
        center
        + drift
        + (radius * np.array([np.cos(angle), rng.uniform(0.6, 1.0) * np.sin(angle)])).T
    )
    before, after = ring[0] - ring[1], ring[-1] - ring[-2]
    tail = np.arange(1, int(rng.integers(2, 9)))[:, None]
    xy = np.concatenate([ring[0] + before * tail[::-1], ring, ring[-1] + after * tail])
    z = np.clip(np.linspace(0, 1, len(xy)) + rng.normal(0, 0.25, len(xy)), 0, 1)[:, None]
    return interpolate(np.concatenate([xy, z], 1).astype(np.float32), spacing)


def normals(curve: FloatArray) -> FloatArray:
    """Unit normals (m, 2) of the x, y part of ``curve`` (m, ≥ 2)."""
    x, y = curve[:, 0].astype(np.float32), curve[:, 1].astype(np.float32)
    dx, dy = np.empty_like(x), np.empty_like(y)
    for step, line in ((dx, x), (dy, y)):
        step[1:-1] = line[2:] - line[:-2]
        step[0], step[-1] = line[1] - line[0], line[-1] - line[-2]
    length = np.maximum(np.hypot(dx, dy), 1e-9)
    return np.stack([-dy / length, dx / length], 1)


def axes(angle_rad: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors along ``angle_rad`` and across it."""
    along = np.array([np.cos(angle_rad), np.sin(angle_rad)])
    return along, np.array([-along[1], along[0]])


def _from_border(
    rng: np.random.Generator, height: int, width: int, margin: float
) -> tuple[NDArray[np.floating], float]:
    side = rng.choice(4, p=np.array([width, height, width, height]) / (2 * (width + height)))
    along = rng.uniform(0.03, 0.97)
    start = [
        (along * width, -margin),
        (width + margin, along * height),
        (along * width, height + margin),
        (-margin, along * height),
    ][side]
    inward = (0.5, 1.0, -0.5, 0.0)[side] * np.pi
    return np.asarray(start), float(inward + rng.normal(0.0, 0.45))
