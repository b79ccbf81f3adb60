"""A network adapted to ten labelled photographs: what it gains on the other forty, and what it
loses elsewhere.

    python -m tests.benchmarks.bench_adaptation [SHARED] [--minutes M] [--measure] [--shares]

Ten photographs of ``photos100`` (every fifth by name) go through
``models.training.foreground.adaptation`` as a user's would: eight train, two are kept aside. Then
Dice at the network's one threshold, mean over the pictures: on the other forty, and on ``ewd``,
``sbhc`` and ``bwh``, of the parent and of the adapted network. With ``--measure`` a training that
is there is only measured. ``--shares`` measures every mixture of the weights. The adapted network
is never kept. Writes ``build/bench/adaptation.json``.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from models.segmentation.segment import ForegroundInput, segment
from models.weights.inference import WEIGHTS, NetworkSpec, Runtime, default_name, manifest, opened
from tests.benchmarks.bench_foreground import SETS, pictures, score

OUT = Path("build/bench/adaptation.json")
FOLDER = Path("build/adaptation")
_EVERY = 5
Measure = Callable[[np.ndarray], np.ndarray]


def prepare(shared: Path, folder: Path) -> list[str]:
    """Every fifth photograph with its mask to ``folder``; their names."""
    shutil.rmtree(folder, ignore_errors=True)
    for part in ("imgs", "masks"):
        (folder / part).mkdir(parents=True)
    chosen = list(pictures(shared / "data" / "photos100", SETS["photos100"]))[::_EVERY]
    for name, image, mask in chosen:
        cv2.imwrite(str(folder / "imgs" / f"{name}.png"), image[:, :, ::-1])
        cv2.imwrite(str(folder / "masks" / f"{name}.png"), mask.astype(np.uint8) * 255)
    return [name for name, _, _ in chosen]


def measured(
    shared: Path, data: bytes, spec: NetworkSpec, learnt: set[str], every: int = 1
) -> dict[str, float]:
    """Mean Dice in percent by set, over one picture of ``every``; without the pictures in
    ``learnt``."""
    network, settings = (
        opened(spec, data, Runtime(threads=1)),
        ForegroundInput.from_manifest(spec.preprocess),
    )
    out = {}
    for name in ("photos100", "ewd", "sbhc", "bwh"):
        rows = [
            score(segment(image, network, settings) >= settings.threshold, mask)["dice"]
            for stem, image, mask in islice(
                pictures(shared / "data" / name, SETS[name]), 0, None, every
            )
            if name != "photos100" or stem not in learnt
        ]
        out[name] = round(100 * float(np.mean(rows)), 2)
        print(f"{name}: {out[name]}", flush=True)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--minutes", type=float, default=8.0)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--measure", action="store_true")
    parser.add_argument("--shares", action="store_true")
    parser.add_argument(
        "--every", type=int, default=1, help="measure on one picture of so many, for a quick look"
    )
    args = parser.parse_args()
    spec = manifest()[default_name("foreground")]
    parent = WEIGHTS / spec.file
    if not args.measure:
        prepare(args.shared, FOLDER)
        command = [sys.executable, "-m", "models.training.foreground.adaptation", str(FOLDER)]
        command += [
            "--parent",
            str(parent),
            "--network",
            str(spec.training.get("network", "compact")),
        ]
        subprocess.run(
            [*command, "--minutes", str(args.minutes), "--threads", str(args.threads)],
            check=True,
            stdout=subprocess.DEVNULL,
        )
    learnt = {file.stem for file in (FOLDER / "imgs").iterdir()}
    report = json.loads((FOLDER / "report.json").read_text())
    adapted = (FOLDER / "network.onnx").read_bytes()
    result = {
        "parent": spec.name,
        "minutes": round(report["seconds"] / 60, 1),
        "report": report,
        "every": args.every,
        "before": measured(args.shared, parent.read_bytes(), spec, learnt, args.every),
        "after": measured(args.shared, adapted, spec, learnt, args.every),
    }
    if args.shares:
        result["shares"] = _every_share(args.shared, spec, learnt, args.every)
    OUT.parent.mkdir(parents=True, exist_ok=True)
    OUT.write_text(json.dumps(result, indent=1))
    print(json.dumps(result, indent=1))


def _every_share(
    shared: Path, spec: NetworkSpec, learnt: set[str], every: int
) -> dict[str, dict[str, float]]:
    from models.training.foreground.adaptation.choice import SHARES
    from models.training.foreground.adaptation.run import refolded

    files = refolded(
        FOLDER, str(spec.training.get("network", "compact")), WEIGHTS / spec.file, SHARES
    )
    return {
        f"{share:g}": measured(shared, data, spec, learnt, every) for share, data in files.items()
    }


if __name__ == "__main__":
    main()
