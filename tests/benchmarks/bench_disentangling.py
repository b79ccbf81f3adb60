"""Disentangling in a simulated world: seen as a mask with points in space, acted on with errors.

    python -m tests.benchmarks.bench_disentangling [--single 200] [--triple 60]

Each scene's mask is drawn, its topology extracted, the best-ranked action executed on the true harness (holding 2 px,
turning 3 degrees off on average), and the crossings counted there. ``triple``: three crossings, planned again after
every action, at most six; a scene counts if all are gone and their number never rose.
Tuning looked at other seeds (1003, 1004). Prints a table and writes ``build/bench/disentangling.json``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections import Counter
from pathlib import Path
from time import thread_time

import cv2
import numpy as np

from models.topology.disentangling import Action, plan
from models.topology.extraction import extract
from models.topology.train_harness import Harness
from models.topology.train_masks import MaskParams, draw_mask
from tests.benchmarks.bench_topology import Tools, tools
from tests.benchmarks.harness_world import execute, one_crossing, seen_points, truth

SEEN = MaskParams(connectors=0, clips=0.2, tape=0.2, gaps=0, specks=0.1, coarse=0.2, rough=0.6)
MOST_ACTIONS = 6


def look(kit: Tools | None, harness: Harness, rng: np.random.Generator) -> list[Action]:
    """Actions for what a camera sees of the harness; without networks for what is there."""
    if kit is None:
        return plan(truth(harness))
    mask = draw_mask(harness, rng, SEEN)
    return plan(extract(mask, kit.network, kit.judges, surfaces=[seen_points(harness)]))


def single(kit: Tools | None, count: int) -> dict:
    """Scenes with one crossing: does the best-ranked action remove it?"""
    ends: Counter[str] = Counter()
    spent = 0.0
    for k in range(count):
        rng = np.random.default_rng([3, k])
        harness = one_crossing(rng, 1)
        started = thread_time()
        actions = look(kit, harness, rng)
        spent += thread_time() - started
        ends[_end_of(harness, actions, rng)] += 1
    return {"scenes": count, "removed": round(ends["removed"] / count, 4), "ends": dict(ends),
            "ms": round(1e3 * spent / count, 1)}  # fmt: skip


def _end_of(harness: Harness, actions: list[Action], rng: np.random.Generator) -> str:
    if not actions:
        return "no action"
    outcome = execute(harness, actions[0], rng)
    if not outcome.moved:
        return "held down"
    return "still crossed" if outcome.harness.crossings else "removed"


def repeated(kit: Tools | None, count: int, crossings: int = 3) -> dict:
    """Scenes with more crossings, planned again after every action."""
    ends: Counter[str] = Counter()
    used = []
    for k in range(count):
        rng = np.random.default_rng([4, k])
        end, actions = _undo(kit, one_crossing(rng, crossings), rng)
        ends[end] += 1
        used += [actions] if end == "solved" else []
    return {"scenes": count, "solved": round(ends["solved"] / count, 4), "ends": dict(ends),
            "actions": round(float(np.mean(used or [0])), 2)}  # fmt: skip


def _undo(kit: Tools | None, harness: Harness, rng: np.random.Generator) -> tuple[str, int]:
    for step in range(1, MOST_ACTIONS + 1):
        actions = look(kit, harness, rng)
        if not actions:
            return "no action", step
        outcome = execute(harness, actions[0], rng)
        if not outcome.moved:
            return "held down", step
        if len(outcome.harness.crossings) > len(harness.crossings):
            return "count raised", step
        harness = outcome.harness
        if not harness.crossings:
            return "solved", step
    return "too many actions", MOST_ACTIONS


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--single", type=int, default=200)
    parser.add_argument("--triple", type=int, default=60)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    cv2.setNumThreads(1)
    kit = tools()
    results = {}
    for name, seen in (("seen", kit), ("true", None)):
        results[name] = {"single": single(seen, args.single), "triple": repeated(seen, args.triple)}
        print(name, json.dumps(results[name]), flush=True)
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "disentangling.json").write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
