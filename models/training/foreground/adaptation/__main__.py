"""Adapt a network: ``python -m models.training.foreground.adaptation FOLDER --parent FILE``.

``FOLDER`` holds ``imgs/`` and ``masks/``; a run that was cut off goes on from its checkpoint there.
Every line of the output is JSON: ``{"progress": 0.4}``, at the end ``{"problem": …}`` or the
report, which is in ``report.json`` too, beside ``network.onnx`` (when it was accepted) and overlays
of the worst pictures (green right, red invented, blue missed; the parent's on the left).
"""

from __future__ import annotations

import argparse
import json
import sys
import tomllib
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path

import torch

from models.segmentation.segment import ForegroundInput
from models.training.foreground.adaptation.course import CourseParams
from models.training.foreground.adaptation.run import adapt
from models.training.log import Log
from models.weights.inference import WEIGHTS


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit status; 2 when the pictures cannot be used."""
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.adaptation", description=__doc__
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument(
        "--parent", type=Path, default=WEIGHTS / "foreground_compact.onnx", help="its ONNX file"
    )
    parser.add_argument("--network", default="compact", help="the parent's architecture")
    parser.add_argument(
        "--preprocess", type=Path, help="JSON: how the parent is fed; default: as the shipped one"
    )
    parser.add_argument(
        "--keep-aside", type=float, default=0.2, help="share of the pictures that measures only"
    )
    parser.add_argument("--threads", type=int, default=1)
    for field in fields(CourseParams):
        parser.add_argument(f"--{field.name}", type=type(field.default), default=field.default)
    args = parser.parse_args(arguments)
    torch.set_num_threads(args.threads)
    params = CourseParams(
        **{field.name: getattr(args, field.name) for field in fields(CourseParams)}
    )
    fed = ForegroundInput.from_manifest(_preprocess(args.preprocess))
    log = Log()
    try:
        report = adapt(args.folder, (args.network, args.parent), fed, params, args.keep_aside, log)
    except ValueError as error:
        log(problem=str(error))
        return 2
    (args.folder / "report.json").write_text(json.dumps(asdict(report)))
    log(**asdict(report))
    return 0


def _preprocess(file: Path | None) -> dict[str, object]:
    if file is not None:
        given: dict[str, object] = json.loads(file.read_text())
        return given
    shipped = tomllib.loads((WEIGHTS / "manifest.toml").read_text())["foreground_compact"]
    preprocess: dict[str, object] = shipped["preprocess"]
    return preprocess


if __name__ == "__main__":
    sys.exit(main())
