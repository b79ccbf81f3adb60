"""``python -m tests.benchmarks``: run the benchmarks one after the other, then write RESULTS.md from their JSON.

    python -m tests.benchmarks [--shared ../shared] [--only http,instances_ewd,…] [--report]

``--report`` runs nothing and only writes the report again from what lies in ``build/bench``.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from tests.benchmarks.report import write_report

OUT = Path("build/bench")


def commands(shared: Path) -> dict[str, list[str]]:
    """Module and arguments of each benchmark, by name."""
    instances = ["tests.benchmarks.bench_instances", str(shared)]
    return {
        "http": ["tests.benchmarks.bench_http"],
        "foreground": ["tests.benchmarks.bench_foreground", str(shared), "--sheets", "build/sheets"],
        "instances_ewd": [*instances, "--set", "ewd", "--repeats", "15", "--sheet", "build/sheets/rt_dlo_ewd.png"],
        "instances_sbhc": [*instances, "--set", "sbhc", "--repeats", "3", "--sheet", "build/sheets/rt_dlo_sbhc.png"],
        "topology": ["tests.benchmarks.bench_topology", str(shared), "--sheet", "build/sheets/topology.png"],
        "disentangling": ["tests.benchmarks.bench_disentangling", "--triple", "40"],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shared", type=Path, default=Path("../shared"))
    parser.add_argument("--only", default="", help="names, separated by commas")
    parser.add_argument("--report", action="store_true")
    args = parser.parse_args()
    failed = []
    Path("build/sheets").mkdir(parents=True, exist_ok=True)
    for name, command in commands(args.shared).items():
        if args.report or (args.only and name not in args.only.split(",")):
            continue
        print(f"== {name}: python -m {' '.join(command)}", flush=True)
        if subprocess.run([sys.executable, "-m", *command], check=False).returncode:
            failed.append(name)
    write_report(OUT, Path(__file__).with_name("RESULTS.md"))
    print(f"failed: {', '.join(failed)}" if failed else "all benchmarks ran")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
