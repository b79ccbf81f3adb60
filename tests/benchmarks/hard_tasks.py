"""What planning brings where a rule does not suffice: hard tasks of two benches counted together.

    python -m tests.benchmarks.hard_tasks

Runs nothing: reads ``build/bench/planner.json`` and ``obstacles.json`` and writes ``hard.json``.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from tests.benchmarks.task_scoring import REACHED_M

RULE = "farthest edge onto its place"


def counted(planner: dict, obstacles: dict) -> dict[str, dict[str, int]]:
    """For each kind of hard tasks how many there are, and how many the planner and the rule
    reach."""
    kinds = {
        "deep S, M, loop": planner["mujoco_hard"],
        "eight times as stiff": planner["mujoco_stiff"],
        "behind pegs": obstacles,
    }
    return {
        kind: {
            "tasks": len(choices["default"]["rows"]),
            "default": _reached(choices["default"]["rows"]),
            "rule": _reached(choices[RULE]["rows"]),
        }
        for kind, choices in kinds.items()
    }


def _reached(rows: list[dict]) -> int:
    return sum(row["errors_mm"][-1] <= 1e3 * REACHED_M for row in rows)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    out = parser.parse_args().out
    planner, obstacles = (
        json.loads((out / f"{name}.json").read_text()) for name in ("planner", "obstacles")
    )
    found = counted(planner, obstacles)
    print(json.dumps(found))
    (out / "hard.json").write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
