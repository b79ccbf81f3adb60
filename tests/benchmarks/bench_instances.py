"""RT-DLO on real photographs: quality on identical masks, crossings, and time on one thread.

    python -m tests.benchmarks.bench_instances [SHARED] [--set ewd|sbhc] [--orientation network|axis]

``ewd``: the published network masks ``masks_r101`` at threshold 77, instances against labels by
category. ``sbhc``: the foreground of the labels as mask. Time: the instance stage (mask to scene,
labels included) per image, best and median of the repeats, and as a ratio to
``skimage.morphology.skeletonize`` on the same mask in the same run. ``--sheet FILE`` writes the ten
worst overlays. Prints tables and writes ``build/bench/instances_<set>.json``.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, thread_time

import cv2
import numpy as np
from skimage.morphology import skeletonize

from models.instances.overlay import overlay
from models.instances.published.rt_dlo import OrientationNetwork, RtDloParams, extract
from models.instances.scene import Scene
from tests.benchmarks.scoring import (
    FoundCrossing,
    crossings_in_labels,
    score_crossings,
    score_labels,
)

THRESHOLD = 77


@dataclass(frozen=True)
class Photo:
    """``image``: (H, W, 3) RGB; ``mask``: (H, W) bool; ``labels``: (H, W) true instances."""

    name: str
    image: np.ndarray
    mask: np.ndarray
    labels: np.ndarray


def photos(root: Path, name: str) -> Iterator[Photo]:
    """The photographs of a set, by name."""
    folder = root / "data" / name
    for path in sorted((folder / "imgs").iterdir()):
        image = np.ascontiguousarray(cv2.imread(str(path))[:, :, ::-1])
        labels = _read_labels(folder / "labels" / f"{path.stem}.png")
        size = image.shape[1::-1]
        if name == "ewd":
            probability = cv2.imread(
                str(folder / "masks_r101" / f"{path.stem}.png"), cv2.IMREAD_GRAYSCALE
            )
            mask = cv2.resize(probability, size) >= THRESHOLD
        else:
            mask = (
                cv2.resize((labels > 0).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
            )
        yield Photo(path.stem, image, mask, labels)


def _read_labels(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image.ndim == 2:
        return image.astype(np.int64)
    return image[:, :, :3].astype(np.int64) @ np.array([1, 256, 65536])


def measure(
    photo: Photo, network: OrientationNetwork | None, repeats: int
) -> tuple[Scene, dict[str, object]]:
    """The scene of one photograph and its row of the table."""
    params = RtDloParams()
    scene = extract(photo.mask, photo.image, params, [network] if network else [])
    stage, processor = _times(
        lambda: extract(photo.mask, photo.image, params, [network] if network else []), repeats
    )
    skeleton, _ = _times(lambda: skeletonize(photo.mask), repeats)
    found = [
        FoundCrossing(np.array(c.xy), c.over.instance, c.under.instance, c.score)
        for c in scene.crossings
        if c.over.instance != c.under.instance
    ]
    return scene, {
        "name": photo.name,
        **score_labels(scene.labels, photo.labels),
        "crossings": score_crossings(
            found, crossings_in_labels(photo.labels), scene.labels, photo.labels
        ),
        "best_ms": min(stage),
        "median_ms": float(np.median(stage)),
        "processor_ms": min(processor),
        "skeletonize_ms": min(skeleton),
        "parts_ms": scene.timings_ms,
    }


def _times(call: Callable[[], object], repeats: int) -> tuple[list[float], list[float]]:
    """Wall-clock and processor time of each call, in ms; the second says what a busy machine
    added."""
    wall, processor = [], []
    for _ in range(repeats):
        started, worked = perf_counter(), thread_time()
        call()
        wall.append(1e3 * (perf_counter() - started))
        processor.append(1e3 * (thread_time() - worked))
    return wall, processor


def report(rows: list[dict], groups: list[str]) -> dict[str, object]:
    """Scores in percent per group (name prefix), crossings and times over all rows."""
    quality = {}
    for group in groups:
        chosen = [row for row in rows if row["name"].startswith(group)]
        keys = ("iou", "iou_strict", "dice", "pq", "count", "sem_dice")
        quality[group or "all"] = {"n": len(chosen)} | {
            key: round(100 * float(np.mean([row[key] for row in chosen])), 2) for key in keys
        }
    return {"quality": quality, "crossings": _crossing_report(rows), "time": _time_report(rows)}


def _crossing_report(rows: list[dict]) -> dict[str, float]:
    total = {
        key: sum(row["crossings"][key] for row in rows) for key in ("true", "predicted", "found")
    }
    orders = [order for row in rows for order in row["crossings"]["orders"]]
    right = sum(1 for _, is_right in orders if is_right)
    return total | {
        "recall": round(100 * total["found"] / max(total["true"], 1), 2),
        "order_right": round(100 * right / max(len(orders), 1), 2),
        "mean_score": round(100 * float(np.mean([score for score, _ in orders] or [0])), 2),
    }


def _time_report(rows: list[dict]) -> dict[str, object]:
    """Over the images: median and 95th percentile, in ms, and the median ratio."""
    kinds = {
        "best_of_repeats": "best_ms",
        "median_of_repeats": "median_ms",
        "processor": "processor_ms",
    }
    times = {kind: np.array([row[key] for row in rows]) for kind, key in kinds.items()}
    skeleton = np.array([row["skeletonize_ms"] for row in rows])
    parts = sorted({part for row in rows for part in row["parts_ms"]})
    return {
        **{
            kind: {
                "median": round(float(np.median(ms)), 2),
                "p95": round(float(np.percentile(ms, 95)), 2),
            }
            for kind, ms in times.items()
        },
        "skeletonize": round(float(np.median(skeleton)), 2),
        "ratio_to_skeletonize": round(float(np.median(times["best_of_repeats"] / skeleton)), 2),
        "parts": {
            p: round(float(np.median([r["parts_ms"].get(p, 0) for r in rows])), 2) for p in parts
        },
    }


def contact_sheet(rows: list[dict], pictures: dict[str, np.ndarray], count: int = 10) -> np.ndarray:
    """The worst overlays by strict IoU, two a row, BGR."""
    tiles = []
    for row in sorted(rows, key=lambda r: r["iou_strict"])[:count]:
        tile = cv2.resize(pictures[row["name"]], (640, 360))[:, :, ::-1].copy()
        text = f"{row['name']} iou {100 * row['iou']:.0f} strict {100 * row['iou_strict']:.0f}"
        cv2.putText(
            tile, text, (8, 350), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (255, 255, 255), 2, cv2.LINE_AA
        )
        tiles.append(tile)
    tiles += [np.zeros_like(tiles[0])] * (len(tiles) % 2)
    return np.vstack([np.hstack(tiles[k : k + 2]) for k in range(0, len(tiles), 2)])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--set", choices=["ewd", "sbhc"], default="ewd")
    parser.add_argument("--orientation", choices=["network", "axis"], default="network")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--sheet", type=Path, help="write the ten worst overlays here")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    cv2.setNumThreads(1)
    network = _orientation_network() if args.orientation == "network" else None
    rows, pictures = [], {}
    for photo in photos(args.shared, args.set):
        scene, row = measure(photo, network, args.repeats)
        rows.append(row)
        if args.sheet:
            pictures[photo.name] = overlay(photo.image, scene)
    summary = report(rows, ["", "c1", "c2", "c3"] if args.set == "ewd" else ["", "s1", "s2", "s3"])
    _print(summary, rows)
    args.out.mkdir(parents=True, exist_ok=True)
    result = {"set": args.set, "orientation": args.orientation, **summary, "images": rows}
    (args.out / f"instances_{args.set}.json").write_text(json.dumps(result, indent=1))
    if args.sheet:
        cv2.imwrite(str(args.sheet), contact_sheet(rows, pictures))


def _orientation_network() -> OrientationNetwork:
    from models.weights.inference import Runtime, load

    return load("rt_dlo_orientation", Runtime(threads=1))


def _print(summary: dict, rows: list[dict]) -> None:
    for group, scores in summary["quality"].items():
        print(f"{group:4s} " + "  ".join(f"{key} {value}" for key, value in scores.items()))
    print("crossings " + "  ".join(f"{key} {value}" for key, value in summary["crossings"].items()))
    print("time " + json.dumps(summary["time"]))
    worst = sorted(rows, key=lambda r: r["iou_strict"])[:10]
    print("worst " + "  ".join(f"{r['name']} {100 * r['iou_strict']:.0f}" for r in worst))


if __name__ == "__main__":
    main()
