"""Ropes around pegs and into clips, in MuJoCo, which no model has seen.

    python -m tests.benchmarks.bench_fixtures [--pegs 16] [--clips 12] [--mixed 12] [--only-default]

A rope of the thesis lies straight in any direction from where the route starts; it is dragged,
never lifted over a peg. Solved: every peg on its side with no more than 20 mm of room, every clip
filled, in order, judged on the simulated rope (:func:`fixture_scenes.solved`), after at most 15
actions. Stiffness and friction are not told. Beside the planner: the last edge pulled from stop to
stop in straight lines, and into clips the edge that belongs there, without a look at slack or
contact; and no motion, which solves none, as no scene begins solved. Prints a line a scene and
writes ``build/bench/fixtures.json``. About ten minutes on one core.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from time import thread_time

import numpy as np

from models.manipulation.fixtures import Fixtures
from models.manipulation.limits import Limits
from models.manipulation.routing import FINE, Goal, World, likely_stiffness, routed
from models.manipulation.scaling import MOVE_SCALE
from tests.benchmarks.fixture_scenes import SLACK_M, FixtureTable, Scene, scenes, solved

ACTIONS = 15
_LATEST = 4
_SEEDS = {"pegs": 11, "clips": 12, "mixed": 13}


@dataclass
class Planner:
    """The planner among fixtures, for the goal that ``goal`` makes; ``ms`` of each action."""

    fixtures: Fixtures
    goal: Callable[[], Goal]
    ms: list[float] = field(default_factory=list)
    items: list[tuple] = field(default_factory=list)

    def __call__(self, state: np.ndarray) -> tuple[int, np.ndarray] | None:
        started = thread_time()
        goal, world = self.goal(), World(self.fixtures, Limits())
        if self.items:
            seen = (np.array(part) for part in zip(*self.items[-_LATEST:], strict=True))
            world = World(world.fixtures, Limits(), likely_stiffness(world, *seen))
        found = routed(world, state, goal)
        self.ms.append(1e3 * (thread_time() - started))
        return (int(found.edge[0]), found.move[0]) if len(found.edge) else None

    def done(self, before: np.ndarray, edge: int, move: np.ndarray, after: np.ndarray) -> None:
        self.items.append((before, edge, move, after))


def planned(scene: Scene) -> Planner:
    """For the scene's route."""
    route = scene.route()
    return Planner(scene.fixtures(), lambda: Goal(route.shape(scene.kind.length, FINE), route))


@dataclass
class Pulled:
    """The last edge from stop to stop; a clip gets the edge that is as far along the rope as the
    clip is on the way."""

    scene: Scene
    at: int = 0

    def __call__(self, state: np.ndarray) -> tuple[int, np.ndarray] | None:
        if self.at >= len(self.scene.order):
            return None
        what, k = self.scene.order[self.at]
        if what == "peg":
            direction = self._towards(self.scene.pegs[k])
            left = np.array([-direction[1], direction[0]])
            room = self.scene.radius + self.scene.half + SLACK_M / 3
            edge, place, turn = (
                FINE - 2,
                self.scene.pegs[k] - self.scene.sides[k] * room * left,
                0.0,
            )
        else:
            x, y, angle = self.scene.clips[k]
            along = (
                float(np.hypot(x - self.scene.start[0], y - self.scene.start[1]))
                / self.scene.kind.length
            )
            edge, place = int(np.clip(along * (FINE - 1), 0, FINE - 2)), np.array([x, y])
            here = np.arctan2(*(state[edge + 1] - state[edge])[::-1])
            turn = float((angle - here + np.pi / 2) % np.pi - np.pi / 2)
        shift = place - state[edge : edge + 2].mean(0)
        if np.abs(shift).max() <= MOVE_SCALE[0]:
            self.at += 1
        share = min(1.0, float(MOVE_SCALE[0] / max(np.abs(shift).max(), 1e-9)))
        return edge, np.clip([*(share * shift), turn], -MOVE_SCALE, MOVE_SCALE)

    def _towards(self, peg: np.ndarray) -> np.ndarray:
        """Direction of the straight way past this peg."""
        what, k = self.scene.order[self.at - 1] if self.at else ("start", 0)
        before = {
            "start": self.scene.start,
            "peg": self.scene.pegs[k : k + 1],
            "clip": self.scene.clips[k : k + 1, :2],
        }
        line = peg - np.reshape(before[what], -1)[:2]
        return np.asarray(line / np.hypot(*line))

    def done(self, before: np.ndarray, edge: int, move: np.ndarray, after: np.ndarray) -> None:
        """It does not look at what it did."""


def run_scene(scene: Scene, choose: Planner | Pulled) -> tuple[bool, int]:
    """Whether it was solved, and after how many actions."""
    table = FixtureTable(scene)
    for used in range(ACTIONS + 1):
        state = table.state()
        if solved(scene, state):
            return True, used
        chosen = choose(state) if used < ACTIONS else None
        if chosen is None:
            return False, used
        table.act(*chosen)
        choose.done(state, *chosen, table.state())
    raise AssertionError("the last turn returns")


def compared(
    what: str, count: int, makers: dict[str, Callable[[Scene], Planner | Pulled]]
) -> dict[str, dict]:
    found: dict[str, dict] = {}
    for name, make in makers.items():
        rows, ms = [], []
        for k, scene in enumerate(scenes(what, count, _SEEDS[what])):
            choose = make(scene)
            ok, used = run_scene(scene, choose)
            rows.append({"solved": ok, "actions": used})
            ms += getattr(choose, "ms", [])
            print(
                what,
                name,
                k,
                scene.kind.name,
                scene.surface,
                "solved" if ok else "not solved",
                used,
                flush=True,
            )
        used = [row["actions"] for row in rows if row["solved"]]
        found[name] = {
            "scenes": count,
            "solved": len(used),
            "median_actions": float(np.median(used)) if used else None,
            "ms": round(float(np.median(ms)), 1) if ms else None,
            "rows": rows,
        }
    return found


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for what, count in {"pegs": 16, "clips": 12, "mixed": 12}.items():
        parser.add_argument(
            f"--{what}",
            type=int,
            default=count,
            help=f"scenes; default {count}, 0 keeps what was measured",
        )
    parser.add_argument("--only-default", action="store_true", help="without the baseline")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    makers: dict[str, Callable[[Scene], Planner | Pulled]] = {"default": planned}
    if not args.only_default:
        makers["pulled from stop to stop"] = Pulled
    stored = args.out / "fixtures.json"
    report = json.loads(stored.read_text()) if stored.exists() else {}
    for what in _SEEDS:
        if getattr(args, what):
            report[what] = compared(what, getattr(args, what), makers)
            stored.write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
