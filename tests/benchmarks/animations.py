"""Animations of shape control for the docs: the planner on a simulated rope that no model has
learned from.

    python -m tests.benchmarks.animations docs/images/shapes [S loop …]

Needs the extra of ``requirements/dynamics.in`` and Pillow. Writes ``NAME.gif`` for each target.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
from pathlib import Path

from dlo_client.demo.shape_drawing import animate
from dlo_client.demo.simulated_table import TARGETS

from tests.benchmarks.bench_planner import Planned, dynamics, run_task, shape
from tests.benchmarks.ropes import HARD_TARGETS, ROPES, FilmedTable

_MOST_PICTURES = 70
_SHOWN = ("U", "S", "loop")


def film(name: str, folder: Path) -> None:
    rope = ROPES[0]
    table, target = FilmedTable(rope, "cloth"), shape(name, rope.length)
    errors, _ = run_task(table, target, rope.mass, Planned(dynamics()))
    kept = table.frames[:: max(1, len(table.frames) // _MOST_PICTURES)]
    animate([frame.tolist() for frame in kept], target.tolist(), folder / f"{name}.gif")
    print(name, [round(1e3 * error, 1) for error in errors], "mm")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("targets", nargs="*", help=f"of {', '.join((*TARGETS, *HARD_TARGETS))}")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    for name in args.targets or _SHOWN:
        film(name, args.folder)


if __name__ == "__main__":
    main()
