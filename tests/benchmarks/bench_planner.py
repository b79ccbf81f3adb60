"""The planner: its network, its parameters, its time, and tasks in two simulators.

    python -m tests.benchmarks.bench_planner [--held-out FILE] [--ropes 40] [--parts own mujoco]

``--held-out``: samples of ``models.training.dynamics.data`` with another seed (made when it is
missing). Tasks: U, A, S and I from a straight line x three ropes x two surfaces with hidden
parameters, at most ten actions, reached below 10 mm; in the own simulator and, with the extra of
``requirements/dynamics.in``, in MuJoCo, which no network has seen. There a deep S, an M and a loop
too, and ropes eight times as stiff. Prints tables and writes ``build/bench/planner.json``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from time import thread_time

import numpy as np
from dlo_client.demo.simulated_table import TARGETS, target_shape

from models.manipulation.actions import best_actions, onto_target
from models.manipulation.belief import Belief, believed, learned
from models.manipulation.chances import chance_of_half
from models.manipulation.dynamics import NODES, Dynamics, shape_distance
from models.manipulation.limits import Limits
from models.manipulation.parameters import MID_RANGE, History, estimate
from models.manipulation.planning import USUAL_HORIZON, plan
from models.manipulation.scaling import MOVE_SCALE
from models.manipulation.simulator import Actions, Ropes, SimulationParams, simulate
from models.training.dynamics.data import Samples, generate, nearly_straight
from models.weights.inference import Runtime, default_name, load
from tests.benchmarks.held_shapes import nearest_held
from tests.benchmarks.ropes import (
    HARD_TARGETS,
    ROPES,
    SURFACES,
    MujocoTable,
    OwnTable,
    Table,
    hard_shape,
)
from tests.benchmarks.task_scoring import (
    ACTIONS,
    REACHED_M,
    calibration_error,
    stated_and_came,
    summary,
)

Choice = Callable[[np.ndarray, np.ndarray, History, float], tuple[int, np.ndarray]]
"""State, target, what happened so far and the rope's mass to an edge and a move."""


def dynamics() -> Dynamics:
    runtime = Runtime(threads=1)
    return Dynamics(
        *(
            load(default_name(n), runtime)
            for n in ("dynamics", "dynamics_by_move", "dynamics_by_rope")
        )
    )


@dataclass
class Planned:
    """The planner as a choice; ``stated`` (probability, distance at which half of the gain is
    there) and processor ``ms`` of every action, all that it learns from the history included."""

    model: Dynamics
    horizon: int = USUAL_HORIZON
    learn: bool = True
    stated: list[tuple[float, float]] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)

    def __call__(
        self, state: np.ndarray, target: np.ndarray, history: History, mass: float
    ) -> tuple[int, np.ndarray]:
        started = thread_time()
        belief = Belief.certain(self.model, np.array([mass, *MID_RANGE]))
        if self.learn:
            belief, _ = learned(self.model, history, mass)
        found, _ = plan(belief, state, target, Limits(), self.horizon)
        edge, move = int(found.edge[0]), found.move[0]
        half = (float(shape_distance(state, target)) + float(found.error[0])) / 2
        self.stated.append((chance_of_half(belief, state, target, edge, move), half))
        self.ms.append(1e3 * (thread_time() - started))
        return edge, move


def at_random(seed: int) -> Choice:
    rng = np.random.default_rng(seed)
    return lambda *_: (int(rng.integers(0, NODES - 1)), rng.uniform(-1, 1, 3) * MOVE_SCALE)


def nearest_edge(state, target, history, mass) -> tuple[int, np.ndarray]:
    """The edge that is farthest from its place is put there, as far as one action reaches."""
    moves = onto_target(state, target, np.arange(NODES - 1))
    edge = int(np.argmax(np.hypot(moves[:, 0], moves[:, 1])))
    return edge, np.clip(moves[edge], -MOVE_SCALE, MOVE_SCALE)


def run_task(
    table: Table, target: np.ndarray, mass: float, choose: Choice
) -> tuple[list[float], History]:
    """Mean distances before the first action and after each, until the target is reached; and what
    was done."""
    empty = np.zeros((0, NODES, 2))
    history = History(empty, np.zeros(0, np.int64), np.zeros((0, 3)), empty)
    state = table.state()
    errors = [float(shape_distance(state, target))]
    while errors[-1] > REACHED_M and len(errors) <= ACTIONS:
        edge, move = choose(state, target, history, mass)
        table.act(edge, move)
        after = table.state()
        history = History(
            np.concatenate([history.before, state[None]]),
            np.append(history.edge, edge),
            np.concatenate([history.move, move[None]]),
            np.concatenate([history.after, after[None]]),
        )
        state = after
        errors.append(float(shape_distance(state, target)))
    return errors, history


def shape(name: str, length: float) -> np.ndarray:
    return (
        hard_shape(name, length)
        if name in HARD_TARGETS
        else np.array(target_shape(name, length, NODES))
    )


def tasks(
    make: Callable[..., Table], choose: Choice, targets: Iterable[str] = TARGETS
) -> list[dict]:
    rows = []
    for kind in ROPES:
        for surface in SURFACES:
            for name in targets:
                target = shape(name, kind.length)
                errors, history = run_task(make(kind, surface), target, kind.mass, choose)
                in_mm = np.round(1e3 * np.array(errors), 2).tolist()
                row = {"rope": kind.name, "surface": surface, "target": name, "errors_mm": in_mm}
                rows.append(row | {"history": history, "mass": kind.mass})
    return rows


def held_by_friction(make: Callable[..., MujocoTable], targets: Iterable[str]) -> int:
    """Tasks in which a rope that is laid down in the target's very shape stays within the 10 mm."""
    kept = 0
    for kind in ROPES:
        for surface in SURFACES:
            for name in targets:
                table, target = make(kind, surface), shape(name, kind.length)
                table.put(target)
                kept += bool(shape_distance(table.state(), target) <= REACHED_M)
    return kept


def parameters_in_tasks(model: Dynamics, rows: list[dict]) -> dict[str, float]:
    """Fig. 5.8: mean prediction error of the next state in mm with mid-range, online and best
    parameters."""
    errors: dict[str, list[float]] = {"mid_range": [], "online": [], "best": []}
    for row in rows:
        h, mass = row["history"], row["mass"]
        best = estimate(model, h, mass).rope(mass)
        for k in range(1, len(h.edge)):
            past = History(h.before[:k], h.edge[:k], h.move[:k], h.after[:k])
            known = {
                "mid_range": np.array([mass, *MID_RANGE]),
                "online": estimate(model, past, mass).rope(mass),
            }
            for name, rope in (known | {"best": best}).items():
                reached = model.predict(
                    h.before[k : k + 1], h.edge[k : k + 1], h.move[k : k + 1], rope
                )
                errors[name].append(1e3 * float(shape_distance(reached, h.after[k : k + 1])[0]))
    return {name: round(float(np.mean(values)), 3) for name, values in errors.items()}


def identify(model: Dynamics, ropes: int, actions: int = 5) -> dict[str, float]:
    """Ropes of random parameters, ``actions`` random actions each: how near the estimates come."""
    rng = np.random.default_rng(77)
    rope = Ropes.random(rng, ropes)
    state = nearly_straight(rng, rope.length)
    parts = []
    for _ in range(actions):
        act = Actions.random(rng, ropes, NODES)
        after = simulate(state, act, rope, SimulationParams(steps=160))
        parts.append((state, act.edge, np.column_stack([act.shift, act.turn]), after))
        state = after
    off, ratio, within = [], [], []
    for k in range(ropes):
        history = History(*(np.array([part[i][k] for part in parts]) for i in range(4)))
        found = estimate(model, history, float(rope.mass[k]), float(rope.length[k]))
        logs = np.log([found.bending / rope.bending[k], found.damping / rope.damping[k]])
        off.append(abs(np.exp(logs[0]) - 1))
        ratio.append(abs(np.exp(logs[0] - logs[1]) - 1))
        within.append(np.abs(logs) < 1.645 * found.sigma)
    return {
        "ropes": ropes,
        "actions": actions,
        "k_b_within_25_percent": round(100 * float(np.mean(np.array(off) <= 0.25)), 1),
        "ratio_within_25_percent": round(100 * float(np.mean(np.array(ratio) <= 0.25)), 1),
        "median_k_b_error_percent": round(100 * float(np.median(off)), 1),
        "stated_90_percent_covers": round(100 * float(np.mean(within)), 1),
    }


def held_out(model: Dynamics, samples: Samples) -> dict[str, float]:
    before, after = samples.before.astype(float), samples.after.astype(float)
    reached = model.predict(
        before, samples.edge, samples.move.astype(float), samples.rope[:, :3].astype(float)
    )
    middle = np.column_stack([samples.rope[:, :1], np.tile(MID_RANGE, (len(samples), 1))]).astype(
        float
    )
    guessed = model.predict(before, samples.edge, samples.move.astype(float), middle)
    moved = shape_distance(before, after).mean()
    return {
        "samples": len(samples),
        "mean_displacement_mm": round(1e3 * float(moved), 2),
        "error_percent": round(100 * float(shape_distance(reached, after).mean() / moved), 2),
        "error_percent_mid_range": round(
            100 * float(shape_distance(guessed, after).mean() / moved), 2
        ),
    }


def times(model: Dynamics) -> dict[str, float]:
    """Processor milliseconds of one thread: median of 30."""
    rng = np.random.default_rng(3)
    state = nearly_straight(rng, np.array([0.45]))[0]
    target = state.mean(0) + np.array(target_shape("U", 0.45, NODES))
    rope, edges = np.array([0.05, *MID_RANGE]), np.arange(NODES - 1)
    seen = generate(rng, 15, 1, Ropes.same(15, 0.05, 0.2, 10.0, 0.45))
    history = History(
        seen.before.astype(float), seen.edge, seen.move.astype(float), seen.after.astype(float)
    )
    far = state.mean(0) + hard_shape("M", 0.45)
    dry = replace(
        Belief.certain(model, rope),
        stiffness=np.array([0.1, 0.3]),
        weights=np.array([0.0, 0.4, 0.6]),
    )
    work = {
        "action_15_edges": lambda: best_actions(model, state, target, rope, edges),
        "belief_15_samples": lambda: believed(model, rope, history),
        "plan_viscous": lambda: plan(Belief.certain(model, rope), state, target, Limits()),
        "plan_viscous_ahead": lambda: plan(Belief.certain(model, rope), state, far, Limits()),
        "plan_dry": lambda: plan(dry, state, target, Limits()),
        "plan_dry_ahead": lambda: plan(dry, state, far, Limits()),
        "parameters_15_samples": lambda: estimate(model, history, 0.05),
    }
    return {name: _median_ms(call) for name, call in work.items()}


def _median_ms(call: Callable[[], object], repeats: int = 30) -> float:
    taken = []
    for _ in range(repeats):
        started = thread_time()
        call()
        taken.append(1e3 * (thread_time() - started))
    return round(float(np.median(taken)), 1)


def choices(model: Dynamics, simulator: str) -> dict[str, Choice]:
    """The planner and its rivals; those that differ little from them only in MuJoCo's easy
    tasks."""
    found: dict[str, Choice] = {
        "default": Planned(model),
        "farthest edge onto its place": nearest_edge,
    }
    if simulator == "mujoco":
        found |= {
            "horizon 1": Planned(model, 1),
            "one step, mid-range": Planned(model, 1, learn=False),
        }
        found |= {"random": at_random(0)}
    return found


TABLES: dict[str, tuple[Callable[..., Table], Iterable[str]]] = {
    "mujoco": (MujocoTable, TARGETS),
    "mujoco_hard": (MujocoTable, HARD_TARGETS),
    "mujoco_stiff": (partial(MujocoTable, stiffer=8.0), TARGETS),
    "own": (OwnTable, TARGETS),
}


def compared(model: Dynamics, simulator: str, only: list[str] | None) -> dict[str, dict]:
    """What each choice (of the names in ``only``, if there are any) reaches of the simulator's
    tasks."""
    make, targets = TABLES[simulator]
    parts = {}
    for name, choose in choices(model, simulator).items():
        if only and name not in only:
            continue
        rows = tasks(make, choose, targets)
        part = summary(rows)
        if name == "default" and targets is TARGETS:
            part["prediction_mm"] = parameters_in_tasks(model, rows)
        if isinstance(choose, Planned):
            part["ms"] = [round(float(np.quantile(choose.ms, q)), 1) for q in (0.5, 0.9)]
        if isinstance(choose, Planned) and choose.learn:
            part["calibration_error"] = calibration_error(choose.stated, rows)
            part["stated_came"] = stated_and_came(choose.stated, rows)
        part["rows"] = [{k: v for k, v in r.items() if k not in ("history", "mass")} for r in rows]
        parts[name] = part
        print(simulator, name, {k: v for k, v in part.items() if k != "rows"}, flush=True)
    return parts


def of_the_model(model: Dynamics, samples: Path, ropes: int) -> dict:
    """Accuracy of the network and of the parameters, and times."""
    if not samples.exists():
        rng = np.random.default_rng(10**6)
        generate(rng, 1000, 6, Ropes.random(rng, 1000)).save(samples)
    found: dict = {"held_out": held_out(model, Samples.load(samples)), "times_ms": times(model)}
    found["parameters"] = identify(model, ropes)
    for name, values in found.items():
        print(name, json.dumps(values), flush=True)
    return found


def held(simulator: str) -> dict[str, dict[str, int]]:
    """Of a simulator's tasks: how many targets friction holds, and near how many it holds some
    shape."""
    make, targets = TABLES[simulator]
    stiffer = 8.0 if simulator == "mujoco_stiff" else 1.0
    near = [
        nearest_held(kind, friction, stiffer, shape(name, kind.length))
        for kind in ROPES
        for _, friction in SURFACES.values()
        for name in targets
    ]
    count = sum(away is not None and bool(away <= REACHED_M) for away in near)
    return {
        "held_by_friction": {simulator: held_by_friction(make, targets)},
        "nearest_held": {simulator: count},
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--held-out", type=Path, default=Path("build/held_out.npz"))
    parser.add_argument("--ropes", type=int, default=100, help="for the parameters' accuracy")
    parts = ["model", *TABLES]
    parser.add_argument(
        "--parts", nargs="+", choices=parts, default=parts, help="others keep what was measured"
    )
    parser.add_argument("--choices", nargs="+", help="of the planner and its rivals; default: all")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    model, stored = dynamics(), args.out / "planner.json"
    report = json.loads(stored.read_text()) if stored.exists() else {}
    for part in args.parts:
        if part == "model":
            report |= of_the_model(model, args.held_out, args.ropes)
        else:
            report[part] = report.get(part, {}) | compared(model, part, args.choices)
        if part.startswith("mujoco"):
            for name, counted in held(part).items():
                report[name] = report.get(name, {}) | counted
        stored.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
