"""The foreground network on real photographs, what it sees where no cable is, and instances from
RGB.

    python -m tests.benchmarks.bench_foreground [SHARED] [--network NAME] [--sheets DIR]

Dice and IoU per picture at the network's one threshold, then the mean, by set and category: of the
foreground as the service answers it, and of the network alone; on ``m4nh``, whose truth is strokes
of one width, middle lines within a tolerance. Pictures without cables: the background textures
(share of pixels taken for cable, and instances found). RGB to instances on ``ewd``: the whole
chain. Time: the network alone at 640 × 360, two threads. Prints tables, writes
``build/bench/foreground.json`` and, with ``--sheets``, the ten worst pictures of each set.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter

import cv2
import numpy as np
from skimage.morphology import skeletonize

from models.instances.overlay import overlay
from models.instances.scene import Scene
from models.instances.settling import Settled, settle
from models.segmentation.effort import look
from models.segmentation.segment import ForegroundInput, foreground_mask, segment
from models.weights.inference import Network, Runtime, default_name, eight_bit, load, manifest
from tests.benchmarks.bench_instances import contact_sheet, photos
from tests.benchmarks.scoring import score_labels

SETS = {"ewd": "labels", "photos100": "masks", "bwh": "masks", "sbhc": "labels"}
_STROKE_TOLERANCE_PX = 4.0
_OUTLINE_PX = 4
"""What is wrong so near to both is the outline's place, not a cable that is missed or invented."""
_SIDES = ("outside", "inside")
_AWAY = ("missed", "invented")
_OTHERWISE = ("outlines_alone", "a_pixel_wider")
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
Segment = Callable[[np.ndarray], np.ndarray]


def pictures(folder: Path, truth: str) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Name, (H, W, 3) RGB and (H, W) bool truth of every picture of a set."""
    for path in sorted((folder / "imgs").iterdir()):
        image = np.ascontiguousarray(cv2.imread(str(path))[:, :, ::-1])
        file = next(iter(sorted((folder / truth).glob(f"{path.stem}.*"))), None)
        if file is None:
            continue
        labels = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        mask = (labels if labels.ndim == 2 else labels[:, :, :3].max(2)) > 0
        size = image.shape[1::-1]
        yield (
            path.stem,
            image,
            cv2.resize(mask.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0,
        )


def score(found: np.ndarray, true: np.ndarray) -> dict[str, float]:
    both, either = np.count_nonzero(found & true), np.count_nonzero(found | true)
    total = np.count_nonzero(found) + np.count_nonzero(true)
    return {"dice": 2 * both / max(total, 1), "iou": both / max(either, 1)}


def outline(found: np.ndarray, true: np.ndarray) -> dict[str, float]:
    """How far, in pixels on average, the found outline is ``outside`` and ``inside`` of the true
    one; and shares of the true area: what is ``missed`` and what ``invented`` farther from the
    other than an outline's place explains. ``outlines_alone``: the Dice with neither of these two,
    ``a_pixel_wider``: that of the found mask with another pixel all around."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _OUTLINE_PX + 1, 2 * _OUTLINE_PX + 1))
    near = [cv2.dilate(mask.astype(np.uint8), disc) > 0 for mask in (found, true)]
    edge = cv2.morphologyEx(true.astype(np.uint8), cv2.MORPH_GRADIENT, np.ones((3, 3), np.uint8))
    length = max(np.count_nonzero(edge) / 2, 1.0)
    wrong = {"outside": found & ~true & near[1], "inside": true & ~found & near[0]}
    away = {"missed": true & ~near[0], "invented": found & ~near[1]}
    area = max(np.count_nonzero(true), 1)
    wider = cv2.dilate(found.astype(np.uint8), _CROSS) > 0
    otherwise = ((found & near[1]) | away["missed"], wider)
    return (
        {side: np.count_nonzero(where) / length for side, where in wrong.items()}
        | {kind: np.count_nonzero(where) / area for kind, where in away.items()}
        | {k: score(mask, true)["dice"] for k, mask in zip(_OTHERWISE, otherwise, strict=True)}
    )


def measure_set(
    folder: Path, truth: str, probability: Segment, threshold: float, sheet: Path | None
) -> dict:
    rows, tiles = [], []
    for name, image, true in pictures(folder, truth):
        found = probability(image) >= threshold
        rows.append({"name": name, **score(found, true), **outline(found, true)})
        tiles.append((rows[-1]["dice"], name, _compare(image, found, true)))
    if sheet:
        worst = [tile for _, _, tile in sorted(tiles, key=lambda t: t[:2])[:10]]
        worst += [np.zeros_like(worst[0])] * (len(worst) % 2)
        cv2.imwrite(
            str(sheet), np.vstack([np.hstack(worst[k : k + 2]) for k in range(0, len(worst), 2)])
        )
    groups = {"all": rows} | _by_prefix(rows)
    return {
        "groups": {
            g: {"n": len(r)}
            | {k: _percent(r, k) for k in ("dice", "iou", *_AWAY, *_OTHERWISE)}
            | {k: _mean(r, k) for k in _SIDES}
            for g, r in groups.items()
        },
        "worst": [
            (r["name"], round(100 * r["dice"], 1))
            for r in sorted(rows, key=lambda r: r["dice"])[:10]
        ],
    }


def measure_strokes(
    folder: Path, probability: Segment, threshold: float, sheet: Path | None
) -> dict:
    """``m4nh``: its strokes have one width, so middle lines are compared, with a tolerance."""
    rows, tiles = [], []
    for name, image, true in pictures(folder, "labels"):
        found = probability(image) >= threshold
        rows.append({"name": name, "found": _near(true, found), "right": _near(found, true)})
        tiles.append(
            (min(rows[-1]["found"], rows[-1]["right"]), name, _compare(image, found, true))
        )
    ordered = sorted(tiles, key=lambda t: t[:2])[:10]
    if sheet:
        cv2.imwrite(
            str(sheet),
            np.vstack([np.hstack([t[2] for t in ordered[k : k + 2]]) for k in range(0, 10, 2)]),
        )
    return {
        "n": len(rows),
        "tolerance_px": _STROKE_TOLERANCE_PX,
        **{key: _percent(rows, key) for key in ("found", "right")},
        "worst": [(name, round(100 * value, 1)) for value, name, _ in ordered],
    }


def _near(lines: np.ndarray, mask: np.ndarray) -> float:
    """Share of the middle lines of ``lines`` within the tolerance of ``mask``."""
    middle = skeletonize(lines)
    away = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, 5)
    return float(np.mean(away[middle] <= _STROKE_TOLERANCE_PX)) if middle.any() else 0.0


def _by_prefix(rows: list[dict]) -> dict[str, list[dict]]:
    groups: dict[str, list[dict]] = {}
    for row in rows:
        groups.setdefault(row["name"].split("_")[0], []).append(row)
    return groups if 1 < len(groups) < 6 else {}


def _percent(rows: list[dict], key: str) -> float:
    return _mean(rows, key, 100)


def _mean(rows: list[dict], key: str, times: float = 1) -> float:
    return round(times * float(np.mean([row[key] for row in rows])), 2)


def _compare(image: np.ndarray, found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """BGR: right in green, invented in red, missed in blue."""
    tile = image[:, :, ::-1].astype(float) * 0.6
    for where, color in (
        (found & true, (0, 255, 0)),
        (found & ~true, (0, 0, 255)),
        (~found & true, (255, 0, 0)),
    ):
        tile[where] = 0.5 * tile[where] + 0.5 * np.array(color)
    return cv2.resize(tile.astype(np.uint8), (640, 360))


def measure_empty(
    root: Path, probability: Segment, threshold: float, instances: Callable, count: int
) -> dict:
    """Textures without cables: share of pixels taken for one, and pictures in which an instance is
    found.

    ``materials``: 50 scanned materials, which surely hold no cable. ``mixed``: ``count`` pictures
    of all folders, photographs with railings, poles and cords among them.
    """
    materials = _picked(sorted((root / "textures" / "ambientcg128").iterdir()), 50)
    mixed = _picked(
        sorted((root / "textures").glob("*/*.jpg")) + sorted((root / "textures").glob("*/*.png")),
        count,
    )
    return {
        name: _measure_without(files, probability, threshold, instances)
        for name, files in (("materials", materials), ("mixed", mixed))
    }


def _picked(files: list[Path], count: int) -> list[Path]:
    return [files[k] for k in np.random.default_rng(0).permutation(len(files))[:count]]


def _measure_without(
    files: list[Path],
    probability: Segment,
    threshold: float,
    instances: Callable[[np.ndarray], Scene],
) -> dict:
    shares, seen = [], []
    for path in files:
        image = np.ascontiguousarray(cv2.imread(str(path))[:, :, ::-1])
        shares.append(float(np.mean(probability(image) >= threshold)))
        if instances(image).instances:
            seen.append(f"{path.name} ({100 * shares[-1]:.1f} %)")
    return {
        "pictures": len(files),
        "false_pixels_percent": round(100 * float(np.mean(shares)), 4),
        "pictures_with_instances": seen,
    }


def measure_rgb(root: Path, instances: Callable[[np.ndarray], Scene], sheet: Path | None) -> dict:
    rows, drawn = [], {}
    for photo in photos(root, "ewd"):
        scene = instances(photo.image)
        rows.append({"name": photo.name, **score_labels(scene.labels, photo.labels)})
        if sheet:
            drawn[photo.name] = overlay(photo.image, scene)
    if sheet:
        cv2.imwrite(str(sheet), contact_sheet(rows, drawn))
    groups = {"all": rows} | _by_prefix(rows)
    keys = ("iou", "iou_strict", "dice", "pq", "count", "sem_dice")
    return {g: {"n": len(r)} | {k: _percent(r, k) for k in keys} for g, r in groups.items()}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--network", help="default: the manifest's")
    parser.add_argument("--sheets", type=Path, help="folder for the worst pictures")
    parser.add_argument("--empty", type=int, default=200, help="pictures without cables")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    parser.add_argument(
        "--others",
        action="store_true",
        help="only the other networks anew, in the report that is there",
    )
    args = parser.parse_args()
    if args.others:
        others_anew(args.shared / "data" / "ewd", args.out / "foreground.json")
    else:
        measure(args)


def measure(args: argparse.Namespace) -> None:
    network = load(args.network or default_name("foreground"), Runtime(threads=2))
    seeing = load(
        eight_bit(network.spec.name), Runtime(threads=2)
    )  # what looks unless it is to look thoroughly
    settings = ForegroundInput.from_manifest(network.spec.preprocess)

    def alone(image: np.ndarray) -> np.ndarray:
        return look(image, seeing, settings)

    def settled(image: np.ndarray) -> Settled:
        p = alone(image)
        return settle(image, p, foreground_mask(p, settings), settings.threshold)

    def probability(image: np.ndarray) -> np.ndarray:
        return settled(image).probability

    def instances(image: np.ndarray) -> Scene:
        return settled(image).scene

    def sheet(name: str) -> Path | None:
        return args.sheets / f"{name}.png" if args.sheets else None

    if args.sheets:
        args.sheets.mkdir(parents=True, exist_ok=True)
    data, least = args.shared / "data", settings.threshold
    report = {
        "network": seeing.spec.name,
        "sha256": seeing.spec.sha256[:12],
        "threshold": least,
        "sets": {
            name: measure_set(data / name, truth, probability, least, sheet(name))
            for name, truth in SETS.items()
        },
        "alone": {
            name: measure_set(data / name, truth, alone, least, None)["groups"]
            for name, truth in SETS.items()
        },
        "strokes": measure_strokes(data / "m4nh", probability, least, sheet("m4nh")),
        "empty": measure_empty(args.shared, probability, least, instances, args.empty),
        "rgb_to_instances": measure_rgb(args.shared, instances, sheet("rgb")),
        "time_ms": measure_time(alone),
        "others": measure_others(data / "ewd", seeing.spec.name),
    }
    _save(report, args.out)


def _save(report: dict, folder: Path) -> None:
    """Write ``foreground.json`` and print the parts that are not per picture."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "foreground.json").write_text(json.dumps(report, indent=1))
    for name, part in report["sets"].items():
        print(name, json.dumps(part["groups"]))
    for name in ("strokes", "empty", "rgb_to_instances", "time_ms", "others"):
        print(name, json.dumps(report[name]))


def others_anew(folder: Path, file: Path) -> None:
    """Measure the table of the other networks again, in the report of an earlier run."""
    report = json.loads(file.read_text())
    report["others"] = measure_others(folder, report["network"])
    file.write_text(json.dumps(report, indent=1))
    print("others", json.dumps(report["others"]))


def measure_others(folder: Path, but: str) -> dict[str, dict[str, float]]:
    """Dice on ``ewd``, alone and with the clean-up, and time of the manifest's other foreground
    networks, in the same run."""
    found = {}
    for name in (n for n, spec in manifest().items() if spec.task == "foreground" and n != but):
        network = load(name, Runtime(threads=2))
        settings = ForegroundInput.from_manifest(network.spec.preprocess)

        def probability(
            image: np.ndarray, net: Network = network, s: ForegroundInput = settings
        ) -> np.ndarray:
            return segment(image, net, s)

        rows = []
        for picture, image, true in pictures(folder, "labels"):
            seen = probability(image)
            alone, clean = (
                score(mask, true)["dice"]
                for mask in (seen >= settings.threshold, foreground_mask(seen, settings))
            )
            rows.append({"name": picture, "dice": alone, "cleaned": clean})
        groups = {"all": rows} | _by_prefix(rows)
        found[name] = {g: _percent(r, "dice") for g, r in groups.items()} | measure_time(
            probability
        )
        found[name]["cleaned"] = _percent(rows, "cleaned")
    return found


def measure_time(probability: Segment) -> dict[str, float]:
    image = np.random.default_rng(0).integers(0, 255, (360, 640, 3)).astype(np.uint8)
    taken = []
    for _ in range(30):
        started = perf_counter()
        probability(image)
        taken.append(1e3 * (perf_counter() - started))
    return {"median": round(float(np.median(taken)), 2), "best": round(min(taken), 2)}


if __name__ == "__main__":
    main()
