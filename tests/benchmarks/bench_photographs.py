"""The foreground on photographs that nobody prepared, by effort, by scale, and on what holds no
cable.

    python -m tests.benchmarks.bench_photographs [SHARED] [--network NAME] [--sheets DIR]

``wild`` (never trained on) and the part of the training photographs that is kept aside: length
found, share of what is found that is cable, Dice. Photographs without cables kept aside: false
pixels. ``ewd`` and ``photos100`` resized to 0.5 … 2 ×. From RGB on ``ewd``: distance of the
centerlines to the true middle. A drawn 12 megapixel photograph with wires of 14 px: found, and the
time over one pass. Beside every row the figure of an empty answer is 0.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from time import process_time

import cv2
import numpy as np

from models.geometry.polylines import resample
from models.instances.section_matching import extract
from models.instances.settling import settle
from models.segmentation.effort import PASSES, Effort, look
from models.segmentation.segment import ForegroundInput, foreground_mask
from models.synthesis.scenes import SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool
from models.training.foreground.real_pictures import kept_aside
from models.weights.inference import Runtime, default_name, eight_bit, load
from tests.benchmarks.bench_foreground import pictures, score
from tests.benchmarks.bench_instances import photos
from tests.benchmarks.photograph_scoring import UNKNOWN, mean_shares, read_truth, score_photograph

SCALES = (0.5, 0.7, 1.0, 1.5, 2.0)
Mask = Callable[[np.ndarray, Effort], np.ndarray]


def rgb(path: Path) -> np.ndarray:
    return np.ascontiguousarray(cv2.imread(str(path))[:, :, ::-1])


def measure_marked(
    folder: Path, names: list[str], mask: Mask, effort: Effort, sheet: Path | None
) -> dict:
    shares, tiles = [], []
    for name in names:
        image = rgb(folder / "imgs" / f"{name}.jpg")
        strokes, labels = read_truth(folder, name)
        found = mask(image, effort)
        shares.append(score_photograph(found, strokes, labels))
        tiles.append((shares[-1].dice, name, compared(image, found, labels)))
    if sheet:
        worst = [tile for _, _, tile in sorted(tiles, key=lambda t: t[:2])[:10]]
        worst += [np.zeros_like(worst[0])] * (len(worst) % 2)
        cv2.imwrite(
            str(sheet), np.vstack([np.hstack(worst[k : k + 2]) for k in range(0, len(worst), 2)])
        )
    worst_names = [
        (name, round(100 * dice, 1)) for dice, name, _ in sorted(tiles, key=lambda t: t[:2])[:6]
    ]
    return {"n": len(names), **mean_shares(shares), "worst": worst_names}


def compared(image: np.ndarray, found: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """BGR 640 × 480: right in green, invented in red, missed in blue, what cannot be told in
    gray."""
    tile = image[:, :, ::-1].astype(float) * 0.6
    true, known = labels == 255, labels != UNKNOWN
    for where, color in (
        (found & true, (0, 255, 0)),
        (found & known & ~true, (0, 0, 255)),
        (~found & true, (255, 0, 0)),
        (~known, (128, 128, 128)),
    ):
        tile[where] = 0.5 * tile[where] + 0.5 * np.array(color)
    return cv2.resize(tile.astype(np.uint8), (640, 480), interpolation=cv2.INTER_AREA)


def measure_empty(folder: Path, mask: Mask) -> dict:
    shares = {
        f.stem: float(mask(rgb(f), "normal").mean())
        for f in sorted(folder.glob("*.jpg"))
        if kept_aside(f.stem)
    }
    worst = sorted(shares, key=lambda name: -shares[name])[:6]
    return {
        "pictures": len(shares),
        "false_pixels_percent": round(100 * float(np.mean(list(shares.values()))), 3),
        "worst": [(name, round(100 * shares[name], 2)) for name in worst],
    }


def measure_scales(folder: Path, truth: str, mask: Mask, every: int) -> dict[str, float]:
    """Mean Dice with picture and truth at each of ``SCALES``; ``every`` n-th picture."""
    dice: dict[str, list[float]] = {f"{s:g}": [] for s in SCALES}
    for k, (_, image, true) in enumerate(pictures(folder, truth)):
        if k % every:
            continue
        for factor in SCALES:
            size = round(image.shape[1] * factor), round(image.shape[0] * factor)
            way = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
            there = cv2.resize(image, size, interpolation=way)
            label = cv2.resize(true.astype(np.float32), size, interpolation=cv2.INTER_AREA) >= 0.5
            dice[f"{factor:g}"].append(score(mask(there, "normal"), label)["dice"])
    return {name: round(100 * float(np.mean(values)), 2) for name, values in dice.items()}


def measure_middle(root: Path, mask: Mask) -> dict[str, float]:
    """Distance of predicted centerlines on ``ewd``, a point every pixel, to the true middle (the
    ridge of the labels' distance transform), px and in widths; away from crossings: 1.5 widths from
    where one label meets another."""
    px, widths = [], []
    for photo in photos(root, "ewd"):
        scene = extract(mask(photo.image, "normal"), photo.image)
        ridge, meeting = _middle(photo.labels), _meeting(photo.labels)
        away, apart = (
            cv2.distanceTransform((~m).astype(np.uint8), cv2.DIST_L2, 5) for m in (ridge, meeting)
        )
        for instance in scene.instances:
            line = resample(instance.centerline_xy, max(2, round(instance.length_px)))
            column, row = np.rint(line).astype(int).T
            inside = (row >= 0) & (column >= 0) & (row < ridge.shape[0]) & (column < ridge.shape[1])
            row, column = row[inside], column[inside]
            counts = away[row, column] < 1.5 * instance.width_px
            counts &= apart[row, column] > 1.5 * instance.width_px
            px += away[row, column][counts].tolist()
            widths += (away[row, column][counts] / instance.width_px).tolist()
    return {
        "mean_px": round(float(np.mean(px)), 3),
        "mean_widths": round(float(np.mean(widths)), 4),
    }


def _meeting(labels: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels of a label beside those of another."""
    kernel = np.ones((3, 3), np.uint8)
    some = labels.astype(np.uint8)
    largest = cv2.dilate(some, kernel)
    smallest = cv2.erode(np.where(some == 0, 255, some).astype(np.uint8), kernel)
    return (some > 0) & (smallest < largest)


def _middle(labels: np.ndarray) -> np.ndarray:
    """Ridge (H, W) bool of each label's distance transform."""
    ridge = np.zeros(labels.shape, bool)
    for k in np.unique(labels[labels > 0]):
        inside = cv2.distanceTransform(np.pad((labels == k).astype(np.uint8), 1), cv2.DIST_L2, 5)[
            1:-1, 1:-1
        ]
        top = (inside >= cv2.dilate(inside, np.ones((3, 3), np.uint8)) - 1e-3) & (inside > 1.5)
        ridge |= top
    return ridge


def measure_large(mask: Mask) -> dict[str, float]:
    """A drawn photograph of 4000 × 3000 px with wires 14 px wide: found, and processor time of each
    effort."""
    params = SceneParams((3000, 4000), (0.0034, 0.0036), 4, empty_share=0.0)
    scene = render_scene(np.random.default_rng(12), params, TexturePool(()))
    image, true = to_uint8(scene.rgb), scene.ids.numpy() > 0
    found, seconds = {}, {}
    for effort in PASSES:
        started = process_time()
        found[effort] = mask(image, effort)
        seconds[effort] = process_time() - started
    lengths = [
        _along(found["normal"], curve[seen])
        for curve, seen in zip(scene.centerlines, scene.visible, strict=True)
        if seen.any()
    ]
    return {
        "wires": len(lengths),
        "dice": round(100 * score(found["normal"], true)["dice"], 1),
        "least_found_percent": round(100 * min(lengths), 1),
        **{
            f"time_{effort}_over_fast": round(s / seconds["fast"], 2)
            for effort, s in seconds.items()
        },
    }


def _along(mask: np.ndarray, curve: np.ndarray) -> float:
    """Share of the samples of ``curve`` (m, ≥ 2) that are in ``mask``."""
    column, row = np.rint(curve[:, :2]).astype(int).T
    return float(mask[row.clip(0, mask.shape[0] - 1), column.clip(0, mask.shape[1] - 1)].mean())


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--network", help="default: the manifest's")
    parser.add_argument("--name", default="photographs", help="of the JSON file")
    parser.add_argument("--sheets", type=Path, help="folder for the worst pictures")
    parser.add_argument(
        "--every", type=int, default=1, help="only every n-th picture at other scales"
    )
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    network = load(args.network or default_name("foreground"), Runtime(threads=1))
    small = load(eight_bit(network.spec.name), Runtime(threads=1))
    settings = ForegroundInput.from_manifest(network.spec.preprocess)

    def mask(image: np.ndarray, effort: Effort) -> np.ndarray:
        chosen = small if PASSES[effort].eight_bit else network
        seen = look(image, chosen, settings, effort)
        return settle(image, seen, foreground_mask(seen, settings), settings.threshold).cable

    if args.sheets:
        args.sheets.mkdir(parents=True, exist_ok=True)
    real = args.shared / "real"
    wild = sorted(f.stem for f in (real / "wild" / "imgs").iterdir())
    aside = sorted(f.stem for f in (real / "train" / "imgs").iterdir() if kept_aside(f.stem))
    report: dict = {"network": network.spec.name, "sha256": network.spec.sha256[:12]}
    for name, folder, names in (("wild", real / "wild", wild), ("aside", real / "train", aside)):
        report[name] = {
            effort: measure_marked(
                folder, names, mask, effort, args.sheets and args.sheets / f"{name}_{effort}.png"
            )
            for effort in PASSES
        }
    report["empty"] = measure_empty(real / "backgrounds", mask)
    data = args.shared / "data"
    report["scales"] = {
        name: measure_scales(data / name, truth, mask, args.every)
        for name, truth in (("ewd", "labels"), ("photos100", "masks"))
    }
    report["middle"] = measure_middle(args.shared, mask)
    report["large"] = measure_large(mask)
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / f"{args.name}.json").write_text(json.dumps(report, indent=1))
    print(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
