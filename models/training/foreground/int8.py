"""A shipped foreground network to 8 bits: ``python -m models.training.foreground.int8 --textures
PACK``.

Static quantization (activations uint8, weights int8 a channel) with ranges from scenes that this
repository renders, and, with ``--labelled``, from as many photographs of the training set, one
after the other: photographs have darker shadows and sharper edges, and what is beyond a range is
cut. The first convolutions, up to a quarter of the picture's size, stay in single precision: most
of what 8 bits cost on photographs is lost in them. A network that has ``--learned`` to compute in 8
bits (``rounded.py``) does without.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice, zip_longest
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from onnxruntime.quantization import (
    CalibrationDataReader,
    CalibrationMethod,
    QuantFormat,
    QuantType,
    quantize_static,
)

from models.segmentation.segment import ForegroundInput, segment
from models.synthesis.scenes import WORKSHOP, SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool
from models.training.export import register
from models.training.foreground.real_pictures import load_labelled
from models.weights.inference import WEIGHTS, Card, Network, load, manifest

SINGLE = 6
"""Convolutions, from the picture on, that stay in single precision: an eighth more time, .7 Dice on
photographs."""
_CALIBRATION_SEED, _HELD_OUT_SEED = 60_000_011, 70_000_027


class Pictures(CalibrationDataReader):  # type: ignore[misc]
    """Feeds pictures (H, W, 3), prepared by the manifest."""

    def __init__(
        self, input_name: str, settings: ForegroundInput, pictures: Iterable[NDArray[np.uint8]]
    ) -> None:
        self._feeds = self._make(input_name, settings, pictures)

    @staticmethod
    def _make(
        name: str, settings: ForegroundInput, pictures: Iterable[NDArray[np.uint8]]
    ) -> Iterator[dict[str, NDArray[np.float32]]]:
        seen: list[NDArray[np.float32]] = []

        def catch(planes: NDArray[np.float32]) -> NDArray[np.float32]:
            seen.append(planes)
            return np.zeros_like(planes[:, :1])

        for rgb in pictures:
            segment(rgb, catch, settings)
            yield {name: seen.pop()}

    def get_next(self) -> dict[str, NDArray[np.float32]] | None:
        return next(self._feeds, None)


def calibrating(
    pool: TexturePool, count: int, labelled: Path | None
) -> Iterator[NDArray[np.uint8]]:
    """``count`` rendered pictures, each followed by a photograph of ``labelled`` as far as there
    are some."""
    taken = [] if labelled is None else [p.rgb for p in load_labelled(labelled).photographs]
    order = np.random.default_rng(_CALIBRATION_SEED).permutation(len(taken))
    rendered = (rgb for rgb, _ in scenes(_CALIBRATION_SEED, pool, count))
    photographs = (taken[k] for k in order)
    for both in zip_longest(rendered, islice(photographs, count)):
        yield from (rgb for rgb in both if rgb is not None)


def scenes(
    seed: int, pool: TexturePool, count: int, size: tuple[int, int] = (360, 640)
) -> Iterator[tuple[NDArray[np.uint8], NDArray[np.bool_]]]:
    """Pictures (H, W, 3) and foreground (H, W), of tables and of workshops in turn."""
    for k in range(count):
        params = replace(WORKSHOP, size=size) if k % 2 else SceneParams(size)
        scene = render_scene(np.random.default_rng([seed, k]), params, pool)
        yield to_uint8(scene.rgb), scene.ids.numpy() > 0


def quantize(
    source: Path,
    target: Path,
    settings: ForegroundInput,
    pictures: Iterable[NDArray[np.uint8]],
    single: int = SINGLE,
) -> None:
    """Write ``target``, the 8-bit network of ``source`` with ranges from ``pictures`` (H, W, 3);
    the first ``single`` convolutions stay as they are."""
    graph = onnx.load(source).graph
    quantize_static(
        source,
        target,
        Pictures(graph.input[0].name, settings, pictures),
        quant_format=QuantFormat.QDQ,
        per_channel=True,
        activation_type=QuantType.QUInt8,
        weight_type=QuantType.QInt8,
        calibrate_method=CalibrationMethod.MinMax,
        nodes_to_exclude=[node.name for node in graph.node if node.op_type == "Conv"][:single],
        extra_options={"CalibMovingAverage": True},
    )


def compare(full: Network, small: Network, pool: TexturePool, count: int) -> dict[str, float]:
    """Mean Dice of both on held-out rendered pictures with cables, and how often their masks
    differ."""
    settings = ForegroundInput.from_manifest(full.spec.preprocess)
    dice: dict[str, list[float]] = {"full": [], "int8": []}
    differing = []
    for rgb, truth in scenes(_HELD_OUT_SEED, pool, count):
        masks = {
            n: segment(rgb, net, settings) >= settings.threshold
            for n, net in (("full", full), ("int8", small))
        }
        differing.append(float(np.mean(masks["full"] != masks["int8"])))
        if truth.any():
            for name, mask in masks.items():
                both = np.count_nonzero(mask & truth)
                dice[name].append(2 * both / (np.count_nonzero(mask) + np.count_nonzero(truth)))
    return {
        "rendered_dice": round(float(np.mean(dice["int8"])), 4),
        "rendered_dice_fp32": round(float(np.mean(dice["full"])), 4),
        "differing_pixels": round(float(np.mean(differing)), 5),
    }


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.int8", description=__doc__
    )
    parser.add_argument("--network", default="foreground_compact")
    parser.add_argument("--textures", type=Path, help="pack or folder of backgrounds")
    parser.add_argument(
        "--calibration", type=int, default=200, help="rendered pictures for the ranges"
    )
    parser.add_argument(
        "--labelled", type=Path, help="photographs with masks, as many for the ranges"
    )
    parser.add_argument(
        "--learned", type=Path, help="the network's weights as rounded.py left them"
    )
    parser.add_argument("--held-out", type=int, default=100, help="rendered pictures to compare on")
    return parser.parse_args()


def main() -> None:
    args = _arguments()
    pool, spec = load_pool(args.textures), manifest()[args.network]
    name = f"{args.network}_int8"
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / f"{name}.onnx"
        pictures = calibrating(pool, args.calibration, args.labelled)
        source, single = (args.learned, 0) if args.learned else (WEIGHTS / spec.file, SINGLE)
        quantize(source, made, ForegroundInput.from_manifest(spec.preprocess), pictures, single)
        target = WEIGHTS / made.name
        target.write_bytes(made.read_bytes())
    card = Card(
        version=spec.version,
        task=spec.task,
        default=False,
        input=spec.input,
        license=spec.license,
        origin=f"{args.network} ({spec.sha256[:12]}) quantized by this repository; "
        f"origin of that: {spec.origin}",
        preprocess=spec.preprocess,
        training={
            "command": "python -m models.training.foreground.int8",
            "seed": _CALIBRATION_SEED,
            "calibration_pictures": args.calibration,
            "calibration_photographs": args.labelled is not None,
            "learned_to_round": args.learned is not None,
        },
        metrics={},
    )
    register(name, target, card, spec.parameters)
    manifest.cache_clear()
    metrics = compare(load(args.network), load(name), pool, args.held_out)
    without = {
        "rule": f"{args.network}, of which it is made",
        "rendered_dice": metrics["rendered_dice_fp32"],
    }
    register(name, target, replace(card, metrics=metrics, without=without), spec.parameters)
    of_full = {**spec.metrics, "rendered_dice": metrics["rendered_dice_fp32"]}
    register(args.network, WEIGHTS / spec.file, replace(spec, metrics=of_full), spec.parameters)
    print(name, metrics)


if __name__ == "__main__":
    main()
