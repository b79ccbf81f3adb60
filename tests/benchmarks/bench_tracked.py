"""DLO-WSL (thesis 2.5 and 2.7.3): the corrector on held-out crops, and labels of rendered
multi-view scenes.

    python -m tests.benchmarks.bench_tracked [--scenes N] [--textures TEXTURES.npz] [--sheet PNG]

Corrector: the shipped network on 1000 crops each of two kinds of scene, rendered here with seeds
that nothing else uses. As in the thesis: cables 10 to 20 px thick on textures, nothing else about.
As in training: 5 to 31 px, with tools and boards and other things like cables. The offset is
uniform within 16 px, the direction off by 7 degrees (SD). "Marked" crops show which DLO is meant
(``train_corrector.marked``); "all" are as they fall, also those in which another DLO is nearer to
the middle or the DLO is not to be seen. "Thickness known": the line is read as DLO-WSL reads it.

Labels: a scene has 2 cables marked with 5 clicks each, 10 views, and errors of the hand, the
tracker and the hand-eye calibration (``tracked_scenes.Errors``). IoU: mean over true instances,
then views, then scenes. Per click: that over the clicks. Nothing was tuned on these scenes (seeds
100 and up): tuning used seeds below 50.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from models.geometry.arrays import ByteArray
from models.instances.drawing import palette
from models.synthesis.scenes import render_scene
from models.synthesis.textures import TexturePool, load_pool
from models.tracked_labels.correction import FIRST_SPREAD_PX, CorrectionParams, CropReader
from models.tracked_labels.lines import read_lines, read_lines_at, weighed
from models.tracked_labels.outlines import outline
from models.tracked_labels.tracked import TrackedParams, TrackedView, label_tracked
from models.training.corrector.corrector import errors, marked
from models.training.corrector.crops import CropParams, Crops, crops_of, joined
from models.weights.inference import Network, Runtime, default_name, load
from tests.benchmarks.scoring import score_labels
from tests.benchmarks.tracked_scenes import TrackedScene, tracked_scene

CROPS = {
    "as in the thesis": CropParams(
        seed=2_000_000, per_scene=6, thinnest_px=10, thickest_px=20, clutter=0.0
    ),
    "as in training": CropParams(seed=3_000_000, per_scene=6),
}
VARIANTS = {
    "strokes as drawn, smoothed": TrackedParams(correct=False),
    "thesis: every point by itself, thickness as given": TrackedParams(
        measured=0.0,
        ends=None,
        correction=CorrectionParams(spread_px=(FIRST_SPREAD_PX,), aside_px=0, agree=False),
    ),
    "corrections agree": TrackedParams(measured=0.0, ends=None),
    "corrections agree, width measured": TrackedParams(ends=None),
    "corrections agree, width measured, ends found": TrackedParams(),
}
BEST = "corrections agree, width measured, ends found"


@dataclass(frozen=True)
class Labelled:
    """A scene as labelled by one variant, and its IoU in each view."""

    scene: TrackedScene
    views: list[TrackedView]
    overlaps: list[float]


def corrector(network: Network, pool: TexturePool, count: int) -> dict[str, Any]:
    rows: dict[str, Any] = {}
    for name, params in CROPS.items():
        crops = _held_out(params, pool, count)
        columns, widths = _read(network.run, crops.images)
        believed = crops.widths * np.exp(np.random.default_rng(0).normal(0, 0.1, len(crops.widths)))
        peaks = weighed(columns, widths, believed, FIRST_SPREAD_PX).argmax(1)
        readings = {
            "": read_lines(columns, widths),
            ", thickness known": read_lines_at(columns, widths, peaks),
        }
        clear = np.flatnonzero(marked(crops))[:count]
        for how, reading in readings.items():
            rows[f"{name}, marked{how}"] = errors(reading.take(clear), crops.take(clear))
            rows[f"{name}, all{how}"] = errors(reading.take(slice(count)), crops.take(slice(count)))
    return rows


def _held_out(params: CropParams, pool: TexturePool, count: int) -> Crops:
    """At least ``count`` crops that are marked."""
    parts: list[Crops] = []
    found = 0
    while found < count:
        rng = np.random.default_rng([params.seed, len(parts)])
        parts.append(crops_of(render_scene(rng, params.scene(), pool), rng, params))
        found += int(marked(parts[-1]).sum())
    return joined(parts)


def _read(reader: CropReader, images: ByteArray) -> tuple[np.ndarray, np.ndarray]:
    parts = [reader(images[k : k + 64]) for k in range(0, len(images), 64)]
    columns, widths = (np.concatenate(part) for part in zip(*parts, strict=True))
    return columns, widths


def labels(network: Network, scenes: int, sheet: Path | None) -> dict[str, Any]:
    made = [tracked_scene(seed) for seed in range(100, 100 + scenes)]
    reader = _remembering(network.run)
    done = {
        name: [_label(scene, reader, params) for scene in made] for name, params in VARIANTS.items()
    }
    if sheet is not None:
        cv2.imwrite(str(sheet), _worst(done[BEST])[:, :, ::-1])
    return {name: _row(results) for name, results in done.items()}


def _remembering(reader: CropReader) -> CropReader:
    """Variants that differ only after the corrections read the same crops."""
    known: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def read(crops: ByteArray) -> tuple[np.ndarray, np.ndarray]:
        key = hashlib.sha256(crops.tobytes()).digest()
        if key not in known:
            known[key] = reader(crops)
        return known[key]

    return read


def _label(scene: TrackedScene, reader: CropReader, params: TrackedParams) -> Labelled:
    given = (scene.images, scene.cameras, scene.strokes_m, scene.thickness_m)
    views = label_tracked(*given, reader, params)
    return Labelled(
        scene,
        views,
        [score_labels(v.ids, true)["iou"] for v, true in zip(views, scene.ids, strict=True)],
    )


def _row(results: list[Labelled]) -> dict[str, Any]:
    scenes = np.array([np.mean(r.overlaps) for r in results])
    per_click = np.array([iou / r.scene.clicks for iou, r in zip(scenes, results, strict=True)])
    return {
        "iou": round(100 * float(scenes.mean()), 1),
        "sd": round(100 * float(scenes.std()), 1),
        "worst": round(100 * float(scenes.min()), 1),
        "worst_view": round(100 * min(min(r.overlaps) for r in results), 1),
        "per_click": round(100 * float(per_click.mean()), 2),
        "scenes": [round(100 * float(iou), 1) for iou in scenes],
    }


def _worst(results: list[Labelled], count: int = 9) -> ByteArray:
    """The views with the lowest IoU, outlines and centerlines drawn over them."""
    at = sorted((iou, k, v) for k, r in enumerate(results) for v, iou in enumerate(r.overlaps))[
        :count
    ]
    tiles = []
    for iou, k, v in at:
        canvas, colors = results[k].scene.images[v].copy(), palette()
        for number, strand in enumerate(results[k].views[v].strands, start=1):
            if strand is not None:
                color = tuple(int(c) for c in colors[number])
                for line, closed in ((outline(strand), True), (strand.xy, False)):
                    cv2.polylines(
                        canvas,
                        [np.rint(line * 16).astype(np.int32)],
                        closed,
                        color,
                        1,
                        cv2.LINE_AA,
                        4,
                    )
        text = f"scene {100 + k} view {v}: {100 * iou:.1f}"
        cv2.putText(canvas, text, (8, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 0), 2)
        tiles.append(canvas)
    return np.concatenate(
        [np.concatenate(tiles[k : k + 3], 1) for k in range(0, len(tiles) // 3 * 3, 3)], 0
    )


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--crops", type=int, default=1000)
    parser.add_argument(
        "--textures",
        type=Path,
        default=Path("build/textures.npz"),
        help="pack of background pictures; where there is none they are procedural",
    )
    parser.add_argument("--sheet", type=Path, help="where to draw the worst views")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    network = load(default_name("corrector"), Runtime(threads=1))
    textures = args.textures if args.textures.exists() else None
    result = {
        "backgrounds": "pictures" if textures else "procedural",
        "corrector": corrector(network, load_pool(textures), args.crops),
        "scenes": args.scenes,
        "clicks": tracked_scene(100, views=2).clicks,
        "variants": labels(network, args.scenes, args.sheet),
    }
    print(json.dumps(result, indent=1))
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "tracked.json").write_text(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
