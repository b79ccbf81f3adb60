"""Which data, and which network, finds the foreground best? Many short trainings, equally long.

    python -m models.training.foreground.mixture factorial --real FOLDER --minutes-per-run 2
    python -m models.training.foreground.mixture compare chroma=FOLDER rendered=FOLDER --minutes-per-run 7
    python -m models.training.foreground.mixture networks compact deeplab_resnet50/4 --minutes-per-run 7

``factorial`` is Table 2.2 of the thesis (2.7.2): 4000, 8000 and 16000 synthetic pictures × 0, 1000
and 2000 real ones, all counts times --scale, --runs runs each, mixed by w_r (eq. 2.5). ``compare``
trains on each folder alone, as Table 2.1 does. ``networks`` trains several networks on the same
rendered pictures, and measures them untrained and a rule that needs none. All report Dice on --test
(without it: on rendered pictures held out), ``factorial --marked`` also on the photographs kept
aside, and keep every finished run in a JSON file: the same command continues where it stopped.
Folders as in ``models.synthesis.datasets``.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from models.synthesis.datasets import DatasetError, write_whole
from models.synthesis.scenes import SceneParams
from models.synthesis.textures import load_pool
from models.training.foreground.networks import NETWORKS
from models.training.foreground.short_trainings import (
    Arm,
    Labelled,
    Pictures,
    dice,
    fit,
    from_folder,
    marked,
    mask_of,
    rendered,
    stack,
)
from models.training.foreground.validation import by_color

SYNTHETIC = (4000, 8000, 16000)
REAL = (0, 1000, 2000)
_TRAINING_SEED, _HELD_OUT_SEED = 40_000_003, 50_000_017


class Ledger:
    """Finished runs in a JSON file. ValueError when it was begun with other settings."""

    def __init__(self, file: Path, settings: dict[str, Any]) -> None:
        self.file, self.settings = file, settings
        self.runs: dict[str, dict[str, Any]] = {}
        if file.exists():
            kept = json.loads(file.read_text())
            if kept["settings"] != settings:
                raise ValueError(
                    f"{file} was begun with other settings; name another one with --out"
                )
            self.runs = kept["runs"]

    def add(self, key: str, result: dict[str, Any]) -> None:
        self.runs[key] = result
        self.file.parent.mkdir(parents=True, exist_ok=True)
        write_whole(
            self.file, json.dumps({"settings": self.settings, "runs": self.runs}, indent=1).encode()
        )


def run_all(
    arms: Mapping[str, Callable[[], Arm]], ledger: Ledger, train: Callable[[Arm], dict[str, Any]]
) -> None:
    """Every arm that ``ledger`` does not hold yet."""
    for key, make in arms.items():
        if key not in ledger.runs:
            ledger.add(key, train(make()))
            print(key, json.dumps(ledger.runs[key]), flush=True)


def factorial_arms(
    synthetic: Pictures, real: Pictures, scale: float, runs: int
) -> dict[str, Callable[[], Arm]]:
    """The cells of Table 2.2 by key ``s4000_r1000_run0``; each run takes other pictures of both
    sources."""

    def arm(n_synthetic: int, n_real: int, run: int) -> Arm:
        rng = np.random.default_rng([run, n_synthetic, n_real])
        parts = [(synthetic, n_synthetic), (real, n_real)]
        sources = [p.taken(rng.permutation(len(p.images))[: round(scale * n)]) for p, n in parts]
        ratio = n_real / (n_real + n_synthetic)
        return Arm(sources, (1 - ratio, ratio), run)

    return {
        f"s{s}_r{r}_run{run}": lambda s=s, r=r, run=run: arm(s, r, run)  # type: ignore[misc]
        for run in range(runs)
        for s in SYNTHETIC
        for r in REAL
    }


def factorial_table(runs: Mapping[str, dict[str, Any]], test: str = "dice") -> str:
    """Dice on that ``test``, mean ± standard deviation over the finished runs, with w_r."""
    lines = ["synthetic | " + " | ".join(f"real {r:<18}" for r in REAL)]
    for s in SYNTHETIC:
        cells = []
        for r in REAL:
            scores = [
                run[test]["all"] for key, run in runs.items() if key.startswith(f"s{s}_r{r}_")
            ]
            cells.append(
                f"{np.mean(scores):5.2f} ± {np.std(scores):4.2f} w_r {r / (r + s):.2f}"
                if scores
                else "-"
            )
        lines.append(f"{s:>9} | " + " | ".join(f"{cell:<23}" for cell in cells))
    return "\n".join(lines)


def factorial(args: argparse.Namespace) -> None:
    real = stack((marked if args.marked else from_folder)(args.real), _size(args))
    needed = round(args.scale * max(REAL))
    if len(real.images) < needed:
        raise DatasetError(
            f"{args.real} has {len(real.images)} pictures, --scale {args.scale} needs {needed}"
        )
    count = round(args.scale * max(SYNTHETIC))
    print(
        f"{9 * args.runs} runs: {9 * args.runs * args.minutes_per_run:g} minutes of one core, and {count} renders"
    )
    scenes = rendered(count, SceneParams(_size(args)), load_pool(args.textures), _TRAINING_SEED)
    arms = factorial_arms(stack(scenes, _size(args)), real, args.scale, args.runs)
    ledger = Ledger(args.out, _settings(args, "real", "scale", "marked"))
    tests = {"dice": _test(args)}
    if args.marked:
        tests["photographs"] = list(marked(args.real, aside=True))
    run_all(arms, ledger, _trainer(args, tests, args.minutes_per_run))
    print(factorial_table(ledger.runs))


def compare(args: argparse.Namespace) -> None:
    folders = dict(source.split("=", 1) for source in args.sources)
    arms = {
        f"{name}_run{run}": lambda f=folder, run=run: Arm(
            [stack(from_folder(Path(f)), _size(args))], [1.0], run
        )
        for run in range(args.runs)
        for name, folder in folders.items()
    }
    print(f"{len(arms)} runs: {len(arms) * args.minutes_per_run:g} minutes of one core")
    ledger = Ledger(args.out, _settings(args, "sources"))
    run_all(arms, ledger, _trainer(args, {"dice": _test(args)}, args.minutes_per_run))
    for name in folders:
        runs = [run["dice"] for key, run in ledger.runs.items() if key.startswith(f"{name}_run")]
        print(
            name,
            {group: round(float(np.mean([run[group] for run in runs])), 2) for group in runs[0]},
        )


def networks(args: argparse.Namespace) -> None:
    pool = load_pool(args.textures)
    source = stack(
        rendered(args.count, SceneParams(_size(args)), pool, _TRAINING_SEED), _size(args)
    )
    named = {name: name.partition("/")[::2] for name in args.networks}
    arms = {
        f"{name}_run{run}": lambda n=network, s=slim, run=run: Arm(
            [source], [1.0], run, n, int(s or 1)
        )
        for run in range(args.runs)
        for name, (network, slim) in named.items()
    }
    print(f"{len(arms)} runs: {len(arms) * args.minutes_per_run:g} minutes of one core")
    ledger = Ledger(args.out, _settings(args, "count"))
    tests = {"dice": _test(args)}
    ledger.add(
        "no network", {"dice": dice(by_color, tests["dice"]), "pictures": 0, "parameters": 0}
    )
    run_all(
        {f"untrained {key}": arm for key, arm in arms.items()}, ledger, _trainer(args, tests, 0.0)
    )
    run_all(arms, ledger, _trainer(args, tests, args.minutes_per_run))
    print(f"{'network':28} {'million weights':>15} {'pictures seen':>14}  Dice")
    for key, run in ledger.runs.items():
        print(f"{key:28} {run['parameters'] / 1e6:15.2f} {run['pictures']:14d}  {run['dice']}")


def _test(args: argparse.Namespace) -> list[Labelled]:
    """The pictures of --test, or rendered ones held out."""
    scenes = SceneParams(_size(args), empty_share=0.0)
    return list(
        from_folder(args.test, fit=True)
        if args.test
        else rendered(64, scenes, load_pool(args.textures), _HELD_OUT_SEED)
    )


def _trainer(
    args: argparse.Namespace, tests: Mapping[str, list[Labelled]], minutes: float
) -> Callable[[Arm], dict[str, Any]]:
    """Trains one arm for ``minutes``, or not at all, and scores it on each of the ``tests``."""
    encoder = (
        torch.load(args.pretrained, map_location="cpu", weights_only=True)
        if args.pretrained
        else None
    )

    def train(arm: Arm) -> dict[str, Any]:
        learning = fit(arm, minutes, args.batch, encoder)
        find = mask_of(learning, _size(args))
        return {
            **{name: dice(find, pictures) for name, pictures in tests.items()},
            "pictures": learning.course.steps * args.batch,
            "parameters": sum(p.numel() for p in learning.network.parameters()),
        }

    return train


def _settings(args: argparse.Namespace, *more: str) -> dict[str, Any]:
    names = ("width", "height", "minutes_per_run", "batch", "test", "textures", "pretrained", *more)
    plain = {name: getattr(args, name) for name in names}
    return {name: str(value) if isinstance(value, Path) else value for name, value in plain.items()}


def _size(args: argparse.Namespace) -> tuple[int, int]:
    return args.height, args.width


def main(arguments: Sequence[str] | None = None) -> int:
    args = _parser().parse_args(arguments)
    torch.set_num_threads(1)
    try:
        args.run(args)
    except ValueError as error:
        print(f"error: {error}")
        return 1
    return 0


def _shared_arguments() -> argparse.ArgumentParser:
    shared = argparse.ArgumentParser(add_help=False)
    shared.add_argument(
        "--minutes-per-run",
        type=float,
        default=2.0,
        help="of processor time, on a GPU of the clock",
    )
    shared.add_argument(
        "--runs", type=int, default=1, help="of each cell, with other seeds; the thesis has 3"
    )
    shared.add_argument("--width", type=int, default=160, help="multiple of 32")
    shared.add_argument("--height", type=int, default=96, help="multiple of 32")
    shared.add_argument("--batch", type=int, default=8)
    shared.add_argument(
        "--test", type=Path, help="labelled folder to measure on; without it rendered pictures"
    )
    shared.add_argument(
        "--textures", type=Path, help="pack or folder of backgrounds for what is rendered"
    )
    shared.add_argument(
        "--pretrained", type=Path, help="MobileNetV2 ImageNet weights to begin from"
    )
    return shared


def _parser() -> argparse.ArgumentParser:
    shared = _shared_arguments()
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.mixture",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True)
    table = commands.add_parser(
        "factorial", parents=[shared], help="Table 2.2: synthetic and real by ratio"
    )
    table.add_argument("--real", type=Path, required=True, help="labelled folder of real pictures")
    table.add_argument(
        "--marked", action="store_true", help="masks of --real are 128 where nobody can tell"
    )
    table.add_argument(
        "--scale", type=float, default=0.05, help="all counts of the table times this"
    )
    table.add_argument("--out", type=Path, default=Path("build/bench/mixture.json"))
    table.set_defaults(run=factorial)
    pair = commands.add_parser(
        "compare", parents=[shared], help="one training for each folder, as Table 2.1"
    )
    pair.add_argument("sources", nargs="+", metavar="NAME=FOLDER")
    pair.add_argument("--out", type=Path, default=Path("build/bench/compare.json"))
    pair.set_defaults(run=compare)
    several = commands.add_parser(
        "networks", parents=[shared], help="one training for each network, equally long"
    )
    several.add_argument("networks", nargs="+", metavar="NAME[/SLIM]", help=", ".join(NETWORKS))
    several.add_argument(
        "--count", type=int, default=2000, help="rendered pictures that all of them learn from"
    )
    several.add_argument("--out", type=Path, default=Path("build/bench/networks.json"))
    several.set_defaults(run=networks)
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
