"""Every instance method on masks of several kinds, and by the number of crossings (thesis 3.6.2 to
3.6.4).

    python -m tests.benchmarks.bench_masks [SHARED]

On ``ewd``: the published masks of both backbones, as they are and eroded (Table 3.1, Fig. 3.19); in
place of the salient-object networks of Figs. 3.21 and 3.22, which are not to be had, other
foregrounds that were not made for this: our 8-bit network at its fast setting, and a rule without a
network. By the number of true crossings of a picture: IoU and the time of the stages (Tables 3.3
and 3.4), and Ariadne+ over the number of superpixels (Fig. 3.23). Writes
``build/bench/masks.json``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from models.segmentation.effort import look
from models.segmentation.segment import ForegroundInput, foreground_mask
from models.training.foreground.validation import by_color
from models.weights.inference import Runtime, default_name, eight_bit, load
from tests.benchmarks.bench_instances import THRESHOLD, Photo, photos
from tests.benchmarks.bench_methods import run, stage_times, summary
from tests.benchmarks.instance_methods import METHODS, eroded, method
from tests.benchmarks.scoring import crossings_in_labels

SHOWN = ("iou", "iou_strict", "pq", "count", "ms")


def sources(shared: Path, pictures: list[Photo]) -> dict[str, list[Photo]]:
    """The same pictures with other masks, by name."""
    small = load(eight_bit(default_name("foreground")), Runtime(threads=1))
    settings = ForegroundInput.from_manifest(small.spec.preprocess)

    def published(photo: Photo) -> np.ndarray:
        file = shared / "data" / "ewd" / "masks_r50" / f"{photo.name}.png"
        seen = cv2.imread(str(file), cv2.IMREAD_GRAYSCALE)
        return np.asarray(cv2.resize(seen, photo.mask.shape[::-1]) >= THRESHOLD)

    def fast(photo: Photo) -> np.ndarray:
        return foreground_mask(look(photo.image, small, settings, "fast"), settings)

    kinds: dict[str, Callable[[Photo], np.ndarray]] = {
        "ResNet-101": lambda photo: photo.mask,
        "ResNet-50": published,
        "our network, fast": fast,
        "no network: color": lambda photo: by_color(photo.image),
    }
    return {name: [replace(p, mask=mask(p)) for p in pictures] for name, mask in kinds.items()}


def by_mask(found: dict[str, list[Photo]]) -> list[dict[str, Any]]:
    """A row for every method, mask and number of erosions (of the published ones)."""
    rows = []
    for name in METHODS:
        extract = method(name)
        for source, pictures in found.items():
            for times in range(4 if source.startswith("ResNet") else 1):
                scores = summary(
                    run(extract, pictures, lambda mask, _, n=times: eroded(mask, n))[0]
                )  # type: ignore[misc]
                row = {
                    "method": name,
                    "masks": source,
                    "eroded": times,
                    **{key: scores[key] for key in SHOWN},
                }
                rows.append(row)
                print(row, flush=True)
    return rows


def by_crossings(pictures: list[Photo]) -> dict[str, list[dict[str, Any]]]:
    """Quality and stages of every method, and Ariadne+ over its superpixels, by the number of true
    crossings."""
    groups = defaultdict(list)
    for photo in pictures:
        groups[min(len(crossings_in_labels(photo.labels)), 3)].append(photo)
    methods, superpixels = [], []
    for number, group in sorted(groups.items()):
        for name in METHODS:
            rows = run(method(name), group, lambda mask, _: mask)[0]
            scores = summary(rows)
            methods.append(
                {
                    "crossings": number,
                    "pictures": len(group),
                    "method": name,
                    "iou": scores["iou"],
                    "ms": scores["ms"],
                    "stages": stage_times(rows),
                }
            )
            print(methods[-1], flush=True)
        for count in range(10, 91, 10):
            rows = run(method("ariadne_plus", superpixels=count), group, lambda mask, _: mask)[0]
            superpixels.append(
                {"crossings": number, "superpixels": count, "iou": summary(rows)["iou"]}
            )
    return {"methods": methods, "superpixels": superpixels}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    cv2.setNumThreads(1)
    pictures = list(photos(args.shared, "ewd"))
    for name in METHODS:
        method(name)(pictures[0].mask, pictures[0].image)  # networks and libraries warm up
    report = {"masks": by_mask(sources(args.shared, pictures)), **by_crossings(pictures)}
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "masks.json").write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
