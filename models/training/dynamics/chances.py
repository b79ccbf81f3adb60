"""Fit how probable it is that an action brings half of what is expected of it.

    python -m models.training.dynamics.chances [--tasks 24]

Strategy: the planner solves tasks on tables that none of its models describes: dry friction with
twice the nodes, ropes that are bent at rest, friction that lets go sooner or later, shapes seen
with an error, viscous friction, and grippers that slip. Every action is a row of measurements and whether half of the
expected gain came. The calibration error is that of a fit to two thirds of the tasks on the others.
MuJoCo is not used: it is what the bench measures with. About two seconds a task on one core. Writes
``chances.toml``.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import tomli_w

from models.geometry.polylines import resample
from models.manipulation import chances
from models.manipulation.belief import learned
from models.manipulation.dynamics import NODES, Dynamics, shape_distance
from models.manipulation.frames import FloatArray
from models.manipulation.limits import Limits
from models.manipulation.parameters import History
from models.manipulation.planning import plan
from models.manipulation.simulator import Actions, Ropes, SimulationParams, simulate
from models.manipulation.sliding import Sliders, SlidingParams, ways_slid
from models.training.instances.confidence import calibration_error
from models.training.instances.logistic import fit_logistic
from models.weights.inference import Runtime, default_name, load

_COMMAND = "python -m models.training.dynamics.chances"
_SEED = 41
_FINE = 2 * NODES - 1
_ACTIONS, _REACHED_M = 8, 0.01
_VISCOUS_SHARE = 0.3
_SLIPPING_SHARE, _SLIPS, _HELD = 0.25, 0.7, 0.6
"""Of the tables; of the actions there; and up to which share of the way the rope is held then."""
_STIFFNESS_M, _SLIP_M, _REST_RAD = (0.03, 6.0), (5e-5, 1.5e-3), 0.08
"""Of the ropes with dry friction: stiffness over friction, of 16 nodes; slip a step; bend at rest of
a joint."""
_SEEN_M = 1e-3
_SHRINKAGE = 1e-3


class Table(Protocol):
    """A rope (n, 2) m, and what becomes of it."""

    def act(self, state: FloatArray, edge: int, move: FloatArray) -> FloatArray: ...


@dataclass(frozen=True, eq=False)
class Viscous:
    """The thesis's model, twice as finely simulated as the estimator does."""

    rope: Ropes

    def act(self, state: FloatArray, edge: int, move: FloatArray) -> FloatArray:
        action = Actions(np.array([edge]), move[None, :2], move[2:])
        return simulate(state[None], action, self.rope, SimulationParams(steps=80))[0]


@dataclass(eq=False)
class Dry:
    """Dry friction on 31 nodes, of a rope that need not be straight at rest."""

    ropes: Sliders
    params: SlidingParams
    shape: FloatArray | None = None

    def act(self, state: FloatArray, edge: int, move: FloatArray) -> FloatArray:
        fine = resample(state, _FINE) if self.shape is None else self.shape
        after = ways_slid(fine[None], np.array([2 * edge]), move[None], self.ropes, self.params)
        self.shape = after[0, -1]
        return self.shape[::2]


@dataclass(eq=False)
class Slipping:
    """A table whose gripper often loses the rope on the way, or never had it."""

    table: Table
    rng: np.random.Generator

    def act(self, state: FloatArray, edge: int, move: FloatArray) -> FloatArray:
        share = self.rng.uniform(0.0, _HELD) if self.rng.random() < _SLIPS else 1.0
        return self.table.act(state, edge, share * move)


def random_table(rng: np.random.Generator, length: float, mass: float) -> Table:
    table = _firm_table(rng, length, mass)
    return Slipping(table, rng) if rng.random() < _SLIPPING_SHARE else table


def _firm_table(rng: np.random.Generator, length: float, mass: float) -> Table:
    if rng.random() < _VISCOUS_SHARE:
        bending, damping = float(rng.uniform(0.05, 1.0)), float(rng.uniform(3, 30))
        return Viscous(Ropes.same(1, mass, bending, damping, length))
    stiffness = float(np.exp(rng.uniform(*np.log(_STIFFNESS_M)))) * ((_FINE - 1) / (NODES - 1)) ** 2
    rest = np.full((1, _FINE - 2), rng.normal(0, _REST_RAD / 2))
    slip = float(np.exp(rng.uniform(*np.log(_SLIP_M))))
    params = SlidingParams(steps=32, slip_m=slip, released=int(rng.integers(4, 25)))
    return Dry(Sliders(np.array([stiffness]), rest), params)


def random_target(rng: np.random.Generator, length: float) -> FloatArray:
    """(n, 2) m about its middle: headings of a few waves along the rope, and a turn of all."""
    share = (np.arange(NODES - 1) + 0.5) / (NODES - 1)
    waves = sum(
        rng.normal(0, 0.9 / (k + 1)) * np.cos(np.pi * (k + 1) * share + rng.uniform(-0.4, 0.4)) for k in range(3)
    )
    heading = waves + rng.normal(0, 0.5)
    edges = length / (NODES - 1) * np.column_stack([np.cos(heading), np.sin(heading)])
    points = np.vstack([np.zeros((1, 2)), np.cumsum(edges, 0)])
    return np.asarray(points - points.mean(0))


def task(dynamics: Dynamics, rng: np.random.Generator) -> tuple[list[FloatArray], list[bool]]:
    """Measurements of every action of one task, and whether half of the expected gain came."""
    length, mass = float(rng.uniform(0.3, 0.5)), float(rng.uniform(0.02, 0.1))
    table, target = random_table(rng, length, mass), random_target(rng, length)
    true = np.column_stack([np.linspace(-length / 2, length / 2, NODES), np.zeros(NODES)])
    none = np.zeros((0, NODES, 2))
    history = History(none, np.zeros(0, np.int64), np.zeros((0, 3)), none)
    rows: list[FloatArray] = []
    came: list[bool] = []
    state = true + rng.normal(0, _SEEN_M, true.shape)
    for _ in range(_ACTIONS):
        before = float(shape_distance(state, target))
        if before <= _REACHED_M:
            break
        belief, _ = learned(dynamics, history, mass, length)
        found, _ = plan(belief, state, target, Limits())
        edge, move = int(found.edge[0]), found.move[0]
        rows.append(chances.evidence(belief, state, target, edge, move))
        true = table.act(true, edge, move)
        after = true + rng.normal(0, _SEEN_M, true.shape)
        half = (before + float(found.error[0])) / 2
        came.append(float(shape_distance(after, target)) <= half)
        history = replace(
            history,
            before=np.concatenate([history.before, state[None]]),
            edge=np.append(history.edge, edge),
            move=np.concatenate([history.move, move[None]]),
            after=np.concatenate([history.after, after[None]]),
        )
        state = after
    return rows, came


def fitted_table(rows: list[FloatArray], came: list[FloatArray]) -> dict[str, float]:
    """Coefficients from all tasks, and the error of those from the first two thirds on the others."""
    cut = 2 * len(rows) // 3
    held, truth = np.concatenate(rows[cut:]), np.concatenate(came[cut:]).astype(bool)
    chance = 1 / (1 + np.exp(-(held @ _fit(rows[:cut], came[:cut]))))
    named = zip(chances.FEATURES, _fit(rows, came), strict=True)
    return {name: round(float(w), 4) for name, w in named} | {
        "held_out": len(truth),
        "held_out_came": round(float(truth.mean()), 4),
        "held_out_error": round(calibration_error(chance, truth), 4),
    }


def _fit(rows: list[FloatArray], came: list[FloatArray]) -> FloatArray:
    seen, truth = np.concatenate(rows), np.concatenate(came).astype(bool)
    return fit_logistic(seen, truth, np.full(seen.shape[1], _SHRINKAGE))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", type=int, default=24)
    args = parser.parse_args()
    runtime = Runtime(threads=1)
    names = ("dynamics", "dynamics_by_move", "dynamics_by_rope")
    dynamics = Dynamics(*(load(default_name(name), runtime) for name in names))
    rows, came = [], []
    for k in range(args.tasks):
        measured, worked = task(dynamics, np.random.default_rng([_SEED, k]))
        if measured:
            rows.append(np.array(measured))
            came.append(np.array(worked))
    table = {
        "made_by": {"command": _COMMAND, "tasks": args.tasks, "seed": _SEED},
        "half": fitted_table(rows, came),
    }
    chances.COEFFICIENTS.write_text(tomli_w.dumps(table))
    print(table["half"])


if __name__ == "__main__":
    main()
