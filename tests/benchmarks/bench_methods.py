"""All instance methods on the same masks: quality, worn masks, confidence, parameters, time (thesis
3.6).

    python -m tests.benchmarks.bench_methods [SHARED] [--quick] [--only METHODS]

``ewd``: ``masks_r101`` at threshold 77. ``sbhc``: the labels as mask; ``closed gray`` closes their
1 to 2 px gaps with a 7 x 7 kernel and takes the color away. Worn masks: eroded 1 to 3 times with a
3 x 3 kernel; 8 squares of 5 px cleared around random foreground pixels, seed [5, place of the
picture in the set]. Times are processor time of one thread. Every method has one set of parameters
for everything, except in the two tables that vary them. ``--quick`` leaves those out. Prints tables
and writes ``build/bench/methods.json`` and ``build/sheets/<method>_<set>.png`` (ten worst, with a
line on each of what is wrong).
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from time import thread_time

import cv2
import numpy as np

from models.instances.overlay import overlay
from models.instances.scene import Scene
from tests.benchmarks.bench_instances import Photo, contact_sheet, photos
from tests.benchmarks.instance_methods import (
    METHODS,
    Extract,
    closed,
    eroded,
    gray,
    method,
    with_holes,
)
from tests.benchmarks.reasons import why
from tests.benchmarks.scoring import (
    FoundCrossing,
    crossings_in_labels,
    score_crossings,
    score_labels,
)

Wear = Callable[[np.ndarray, int], np.ndarray]
KEYS = ("iou", "iou_strict", "dice", "pq", "count")


def run(
    extract: Extract, pictures: list[Photo], wear: Wear, colorless: bool = False
) -> tuple[list[dict], list[Scene]]:
    """A row of scores for every picture, and the scenes."""
    rows, scenes = [], []
    for place, photo in enumerate(pictures):
        mask = np.ascontiguousarray(wear(photo.mask, place))
        image = gray(photo.image) if colorless else photo.image
        started = thread_time()
        scene = extract(mask, image)
        elapsed = 1e3 * (thread_time() - started)
        crossings = [
            FoundCrossing(np.array(c.xy), c.over.instance, c.under.instance, c.score)
            for c in scene.crossings
            if c.over.instance != c.under.instance
        ]
        row = {
            "name": photo.name,
            **score_labels(scene.labels, photo.labels),
            "crossings": score_crossings(
                crossings, crossings_in_labels(photo.labels), scene.labels, photo.labels
            ),
            "ms": elapsed,
            "parts_ms": scene.timings_ms,
            "scores": _scores(scene, photo.labels),
            "why": why(scene.labels, photo.labels, mask),
        }
        rows.append(row)
        scenes.append(scene)
    return rows, scenes


def _scores(scene: Scene, true: np.ndarray) -> list[tuple[float, bool]]:
    """(stated probability, whether its IoU with a true instance is above a half) of every
    instance."""
    labels = scene.labels
    if labels.shape != true.shape:
        labels = cv2.resize(labels, true.shape[::-1], interpolation=cv2.INTER_NEAREST)
    out = []
    for number, instance in enumerate(scene.instances, start=1):
        mine = labels == number
        ious = [
            (mine & (true == t)).sum() / max((mine | (true == t)).sum(), 1)
            for t in np.unique(true[mine])
            if t
        ]
        out.append((instance.score, bool(max(ious, default=0.0) > 0.5)))
    return out


def summary(rows: list[dict]) -> dict[str, float]:
    """Means in percent, crossings over all pictures, median time."""
    total = {key: sum(r["crossings"][key] for r in rows) for key in ("true", "predicted", "found")}
    orders = [right for r in rows for _, right in r["crossings"]["orders"]]
    return {
        **{key: round(100 * float(np.mean([r[key] for r in rows])), 2) for key in KEYS},
        "crossings_found": round(100 * total["found"] / max(total["true"], 1), 2),
        "order_right": round(100 * float(np.mean(orders or [1.0])), 2),
        "ms": round(float(np.median([r["ms"] for r in rows])), 2),
        "ms_p95": round(float(np.percentile([r["ms"] for r in rows], 95)), 2),
    }


def calibration(rows: list[dict], bins: int = 10) -> dict[str, object]:
    """Expected calibration error of the instances' scores over equally wide bins, and the curve."""
    pairs = np.array([pair for r in rows for pair in r["scores"]], dtype=float).reshape(-1, 2)
    index = np.minimum((pairs[:, 0] * bins).astype(int), bins - 1)
    curve, error = [], 0.0
    for k in np.unique(index):
        stated, right = pairs[index == k].mean(axis=0)
        curve.append([int((index == k).sum()), round(float(stated), 3), round(float(right), 3)])
        error += (index == k).mean() * abs(stated - right)
    return {"instances": len(pairs), "error": round(float(error), 4), "curve": curve}


def stage_times(rows: list[dict]) -> dict[str, float]:
    """Median of every stage, ms."""
    parts = list(dict.fromkeys(part for r in rows for part in r["parts_ms"]))
    return {p: round(float(np.median([r["parts_ms"].get(p, 0.0) for r in rows])), 2) for p in parts}


WEAR: dict[str, Wear] = {
    "as they are": lambda mask, place: mask,
    "8 holes": with_holes,
    "eroded 1": lambda mask, place: eroded(mask, 1),
    "eroded 2": lambda mask, place: eroded(mask, 2),
    "eroded 3": lambda mask, place: eroded(mask, 3),
}


def main() -> None:
    args = _arguments()
    cv2.setNumThreads(1)
    args.sheets.mkdir(parents=True, exist_ok=True)
    args.out.mkdir(parents=True, exist_ok=True)
    ewd, sbhc = list(photos(args.shared, "ewd")), list(photos(args.shared, "sbhc"))
    parts = ("ewd", "sbhc", "sbhc_closed_gray", "calibration", "stages", "worst")
    result: dict[str, dict] = {part: {} for part in parts}
    if args.only and (args.out / "methods.json").exists():
        result |= json.loads((args.out / "methods.json").read_text())
    for name in args.only.split(",") if args.only else METHODS:
        extract = method(name)
        extract(ewd[0].mask, ewd[0].image)  # networks and libraries warm up
        _measure_ewd(name, extract, ewd, args.sheets, result)
        _measure_sbhc(name, extract, sbhc, args.sheets, result)
        print(name, result["calibration"][name], result["stages"][name], flush=True)
        (args.out / "methods.json").write_text(json.dumps(result, indent=1))
    if not args.quick:
        result["rt_dlo_parameters"] = _rt_dlo_table(ewd)
        result["ariadne_superpixels"] = _superpixel_table(ewd)
    (args.out / "methods.json").write_text(json.dumps(result, indent=1))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--quick", action="store_true")
    parser.add_argument(
        "--only", default="", help="methods, separated by commas; the others' results are kept"
    )
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    parser.add_argument("--sheets", type=Path, default=Path("build/sheets"))
    return parser.parse_args()


def _measure_ewd(
    name: str, extract: Extract, ewd: list[Photo], sheets: Path, result: dict[str, dict]
) -> None:
    """The masks as they are and worn, into ``result``."""
    result["ewd"][name] = {}
    for wear_name, wear in WEAR.items():
        rows, scenes = run(extract, ewd, wear)
        result["ewd"][name][wear_name] = summary(rows)
        print(name, "ewd", wear_name, result["ewd"][name][wear_name], flush=True)
        if wear_name == "as they are":
            result["stages"][name] = stage_times(rows)
            result["calibration"][name] = calibration(rows)
            result["worst"][f"{name} ewd"] = _sheet(rows, scenes, ewd, sheets / f"{name}_ewd.png")


def _measure_sbhc(
    name: str, extract: Extract, sbhc: list[Photo], sheets: Path, result: dict[str, dict]
) -> None:
    """The labels as masks, and closed without color, into ``result``."""
    rows, scenes = run(extract, sbhc, lambda mask, place: mask)
    result["sbhc"][name] = summary(rows)
    result["worst"][f"{name} sbhc"] = _sheet(rows, scenes, sbhc, sheets / f"{name}_sbhc.png")
    rows, _ = run(extract, sbhc, lambda mask, place: closed(mask), colorless=True)
    result["sbhc_closed_gray"][name] = summary(rows)
    print(name, "sbhc", result["sbhc"][name], result["sbhc_closed_gray"][name], flush=True)


def _rt_dlo_table(pictures: list[Photo]) -> dict[str, float]:
    """IoU over sampling ratio and neighbors (Table 3.5)."""
    table = {}
    for neighbors in (4, 8, 16, 32):
        for ratio in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3):
            rows, _ = run(
                method("rt_dlo", sampling_ratio=ratio, neighbors=neighbors),
                pictures,
                WEAR["as they are"],
            )
            table[f"{neighbors} {ratio}"] = summary(rows)["iou"]
            print("rt_dlo", neighbors, ratio, table[f"{neighbors} {ratio}"], flush=True)
    return table


def _superpixel_table(pictures: list[Photo]) -> dict[str, float]:
    """IoU over the number of superpixels (Fig. 3.23)."""
    table = {}
    for count in range(10, 91, 10):
        rows, _ = run(method("ariadne_plus", superpixels=count), pictures, WEAR["as they are"])
        table[str(count)] = summary(rows)["iou"]
        print("ariadne_plus", count, table[str(count)], flush=True)
    return table


def _sheet(
    rows: list[dict], scenes: list[Scene], pictures: list[Photo], path: Path
) -> list[tuple[str, int, str]]:
    """Write the ten worst overlays; returns their names, strict IoU in percent and what is
    wrong."""
    worst = sorted(
        zip(rows, scenes, pictures, strict=True), key=lambda item: item[0]["iou_strict"]
    )[:10]
    overlays = {row["name"]: overlay(photo.image, scene) for row, scene, photo in worst}
    cv2.imwrite(str(path), contact_sheet([row for row, _, _ in worst], overlays))
    return [(row["name"], round(100 * row["iou_strict"]), row["why"]) for row, _, _ in worst]


if __name__ == "__main__":
    main()
