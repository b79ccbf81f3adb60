"""Disentangling in a simulated world: seen as a mask with points in space, acted on with errors.

    python -m tests.benchmarks.bench_disentangling [--single 200] [--triple 240] [--resume]

Each scene's mask is drawn, its topology extracted, the best-ranked action executed on the true
harness (holding 2 px, turning 3 degrees off on average), and the crossings counted there.
``triple``: three crossings, planned again after every action, at most six, on the new picture and
what is carried over from the one before; a scene counts if all are gone and their number never
rose. Tuning looked at other seeds (1003 to 1011). About 12 minutes on two cores; every scene's end
is kept in ``build/bench/disentangling.scenes``, and ``--resume`` goes on with those of an
interrupted run of the same code. Prints a table and writes ``build/bench/disentangling.json``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from pathlib import Path
from time import thread_time

import cv2
import numpy as np

from models.disentangling.carried import Done, readings
from models.disentangling.plan import plan
from models.synthesis.harness import Harness
from models.synthesis.harness_masks import draw_mask
from models.topology.extraction import extract
from models.topology.scene import Topology
from models.training.disentangling.table_world import (
    SEEN,
    execute,
    one_crossing,
    seen_points,
    truth,
)
from tests.benchmarks.bench_topology import Tools, tools

MOST_ACTIONS = 6


@cache
def kit() -> Tools:
    cv2.setNumThreads(1)
    return tools()


def seen(harness: Harness, rng: np.random.Generator) -> Topology:
    """What a camera sees of the harness."""
    mask = draw_mask(harness, rng, SEEN)
    return extract(mask, kit().network, kit().classifiers, surfaces=[seen_points(harness)])


def single(as_seen: bool, k: int) -> tuple[str, float]:
    """A scene with one crossing, does the best-ranked action remove it; and seconds spent on
    looking and planning."""
    rng = np.random.default_rng([3, k])
    harness = one_crossing(rng, 1)
    started = thread_time()
    actions = plan(seen(harness, rng) if as_seen else truth(harness), kit().moves)
    spent = thread_time() - started
    if not actions:
        return "no action", spent
    outcome = execute(harness, actions[0], rng)
    if not outcome.moved:
        return "held down", spent
    return "still crossed" if outcome.harness.crossings else "removed", spent


def triple(as_seen: bool, k: int) -> tuple[str, int]:
    """A scene with three crossings, planned again after every action, on what the picture shows and
    the one before it showed: how it ended, after how many."""
    rng = np.random.default_rng([4, k])
    harness = one_crossing(rng, 3)
    known = [seen(harness, rng) if as_seen else truth(harness)]
    for step in range(1, MOST_ACTIONS + 1):
        plans = ((topology, plan(topology, kit().moves)) for topology in known)
        planned = next(((topology, actions[0]) for topology, actions in plans if actions), None)
        if planned is None:
            return "no action", step
        before, action = planned
        outcome = execute(harness, action, rng)
        if not outcome.moved:
            return "held down", step
        if len(outcome.harness.crossings) > len(harness.crossings):
            return "count raised", step
        harness = outcome.harness
        if not harness.crossings:
            return "solved", step
        done = Done(action.hold.xy, action.pick.xy, action.turn)
        known = readings(before, done, seen(harness, rng)) if as_seen else [truth(harness)]
    return "too many actions", MOST_ACTIONS


Scene = tuple[str, str, int]
"""Which topology is planned on (seen, true), the task (single, triple), and the scene's number."""


def done(scene: Scene) -> tuple[Scene, tuple[str, float]]:
    """A scene's end, and its seconds or actions."""
    as_seen, task, k = scene
    return scene, (single if task == "single" else triple)(as_seen == "seen", k)


def ends_of(scenes: list[Scene], kept: Path) -> dict[Scene, tuple[str, float]]:
    """The ends of all scenes; those that the file ``kept`` holds are not run again, and each new
    one is added to it at once."""
    lines = kept.read_text().splitlines() if kept.exists() else []
    ends = {tuple(scene): (end, much) for scene, (end, much) in map(json.loads, lines)}
    left = [scene for scene in scenes if scene not in ends]
    with ProcessPoolExecutor(os.cpu_count()) as pool, kept.open("a") as file:
        for scene, end in pool.map(done, left):
            print(json.dumps([scene, end]), file=file, flush=True)
            ends[scene] = end
    return {scene: ends[scene] for scene in scenes}


def summary(as_seen: str, ends: dict[Scene, tuple[str, float]]) -> dict[str, dict[str, object]]:
    """The rows of the report for one kind of topology."""
    ones, threes = (
        [end for (seen, of, _), end in ends.items() if (seen, of) == (as_seen, task)]
        for task in ("single", "triple")
    )
    few, many = (Counter(end for end, _ in rows) for rows in (ones, threes))
    actions = [n for end, n in threes if end == "solved"]
    return {
        "single": {
            "scenes": len(ones),
            "removed": round(few["removed"] / max(len(ones), 1), 4),
            "ends": dict(few),
            "ms": round(1e3 * sum(s for _, s in ones) / max(len(ones), 1), 1),
        },
        "triple": {
            "scenes": len(threes),
            "solved": round(many["solved"] / max(len(threes), 1), 4),
            "ends": dict(many),
            "actions": round(float(np.mean(actions or [0])), 2),
        },
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--single", type=int, default=200)
    parser.add_argument("--triple", type=int, default=240)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    parser.add_argument("--resume", action="store_true", help="go on with an interrupted run")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    kept = args.out / "disentangling.scenes"
    if not args.resume:
        kept.unlink(missing_ok=True)
    many = {"triple": args.triple, "single": args.single}
    scenes = [
        (as_seen, task, k)
        for as_seen in ("seen", "true")
        for task, count in many.items()
        for k in range(count)
    ]
    ends = ends_of(scenes, kept)
    results = {as_seen: summary(as_seen, ends) for as_seen in ("seen", "true")}
    print(json.dumps(results, indent=1))
    (args.out / "disentangling.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
