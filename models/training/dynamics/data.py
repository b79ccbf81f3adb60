"""Samples of the simulator for training: ``python -m models.training.dynamics.data FILE``.

As thesis 5.4.1: a nearly straight DLO of random parameters, then actions one after another, a
sample each.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from models.manipulation.simulator import Actions, FloatArray, Ropes, SimulationParams, simulate

NODES = 16
MID_RANGE = {"mass": 0.02, "bending": 0.5, "damping": 14.0}
"""The fixed parameters that thesis 5.7.3 compares with; lengths there are 0.4 to 0.5 m."""


@dataclass(frozen=True, eq=False)
class Samples:
    """N samples, float32: ``before`` and ``after`` (N, n, 2) m, ``edge`` (N,), ``move`` (N, 3) dx,
    dy m and dtheta rad, ``rope`` (N, 4) mass, k_b, k_d, length."""

    before: NDArray[np.float32]
    after: NDArray[np.float32]
    edge: NDArray[np.int64]
    move: NDArray[np.float32]
    rope: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.edge)

    def taken(self, rows: slice | NDArray[np.int64]) -> Samples:
        return Samples(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def save(self, file: Path) -> None:
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(".part.npz")
        np.savez(partial, **{name: getattr(self, name) for name in self.__dataclass_fields__})
        partial.replace(file)

    @staticmethod
    def load(file: Path) -> Samples:
        with np.load(file) as arrays:
            return Samples(**dict(arrays))


def nearly_straight(rng: np.random.Generator, length: FloatArray, nodes: int = NODES) -> FloatArray:
    """(B, n, 2) of random place and heading, with a slight bow: headings that drift by up to some
    15 degrees."""
    batch = len(length)
    bow = rng.normal(0, 0.15, (batch, 3))
    t = np.linspace(0, 1, nodes - 1)
    waves = np.stack([t - 0.5, np.cos(np.pi * t), np.sin(np.pi * t)])
    heading = rng.uniform(-np.pi, np.pi, batch)[:, None] + bow @ waves
    steps = (length / (nodes - 1))[:, None, None] * np.stack([np.cos(heading), np.sin(heading)], -1)
    states = np.concatenate([np.zeros((batch, 1, 2)), np.cumsum(steps, 1)], 1)
    return states - states.mean(1, keepdims=True) + rng.uniform(-0.3, 0.3, (batch, 1, 2))


def generate(
    rng: np.random.Generator,
    sequences: int,
    actions: int,
    ropes: Ropes,
    params: SimulationParams | None = None,
) -> Samples:
    """``sequences`` x ``actions`` samples; ``ropes`` one a sequence."""
    state = nearly_straight(rng, ropes.length)
    rope = np.stack([ropes.mass, ropes.bending, ropes.damping, ropes.length], 1)
    parts = []
    for _ in range(actions):
        act = Actions.random(rng, sequences, NODES)
        after = simulate(state, act, ropes, params)
        move = np.column_stack([act.shift, act.turn])
        parts.append((state, after, act.edge, move, rope))
        state = after
    before, after, edge, move, rope = (
        np.concatenate(column) for column in zip(*parts, strict=True)
    )
    single = [column.astype(np.float32) for column in (before, after, move, rope)]
    return Samples(single[0], single[1], edge, single[2], single[3])


def mid_range(rng: np.random.Generator, count: int) -> Ropes:
    fixed = Ropes.same(count, **MID_RANGE, length=0.45)
    return Ropes(fixed.mass, fixed.bending, fixed.damping, rng.uniform(0.4, 0.5, count))


def joined(parts: list[Samples]) -> Samples:
    return Samples(
        *(
            np.concatenate([getattr(p, name) for p in parts])
            for name in Samples.__dataclass_fields__
        )
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.dynamics.data", description=__doc__
    )
    parser.add_argument("file", type=Path, help="to write (.npz)")
    parser.add_argument("--samples", type=int, default=275_000)
    parser.add_argument(
        "--actions", type=int, default=5, help="k, in sequence from a nearly straight DLO"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--mid-range", action="store_true", help="the fixed parameters of thesis 5.7.3"
    )
    args = parser.parse_args()
    chunk, started, parts = 500, time.process_time(), []
    for k in range(-(-args.samples // (chunk * args.actions))):
        rng = np.random.default_rng([args.seed, k])
        ropes = mid_range(rng, chunk) if args.mid_range else Ropes.random(rng, chunk)
        parts.append(generate(rng, chunk, args.actions, ropes))
    samples = joined(parts)
    samples.save(args.file)
    print(f"{len(samples)} samples in {(time.process_time() - started) / 60:.1f} processor minutes")


if __name__ == "__main__":
    main()
