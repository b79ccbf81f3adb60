"""Metric centerlines from one picture with depth, over scenes with exact truth: error, coverage,
order, foreground.

    python -m tests.benchmarks.bench_depth [--scenes N] [--sigma-mm S] [--tuning]

Round cables of 3.5 mm on a table 0.6 m away, seen by a sensor whose noise is alike in neighboring
pixels, with holes and flying pixels. Baseline: the depth of the pixel under each centerline point.
``--tuning`` takes scenes on which constants may be chosen; the others were looked at for nothing
but their figures.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from time import process_time

import numpy as np

from models.depth.curves import metric_curve
from models.depth.evidence import alone, log_odds
from models.depth.order import covered_stretches, reordered
from models.depth.table import find_table, heights
from models.geometry.polylines import resample
from models.geometry.sampling import read_nearest
from models.instances.scene import Scene
from models.instances.section_matching import extract
from models.synthesis.depth_scenes import DepthScene, DepthSceneParams, depth_scene
from models.synthesis.depth_sensor import SensorParams, sensed

_NINETY = 4.605
"""90 % of a two-dimensional normal distribution is within this squared distance."""
_LEAST_PX = 60.0
_ASTRAY_PX = 10.0
_REPORTED = 1000
"""The first seed of those that no constant was chosen on."""


def measure(seed: int, params: DepthSceneParams, sensor: SensorParams) -> dict[str, list[float]]:
    """Values by name, one a point, a cable or a crossing."""
    scene = depth_scene(np.random.default_rng([41, seed]), params)
    depth = sensed(np.random.default_rng([42, seed]), scene.depth_m, sensor)
    out: dict[str, list[float]] = {
        name: [] for name in ("error", "inside", "raw", "radius", "order", "dice", "ms", "astray")
    }
    table = find_table(depth, scene.camera, np.random.default_rng(0))
    if table is None:
        return out | {"found_table": [0.0]}
    normal, offset = scene.table
    out["found_table"] = [1.0]
    out["table_deg"] = [float(np.degrees(np.arccos(np.clip(table.normal @ normal, -1, 1))))]
    out["table_mm"] = [1000 * abs(table.offset_m - offset)]
    by_height = alone(log_odds(heights(depth, scene.camera, table), table)) > 0.5
    out["dice"] = [
        2 * np.count_nonzero(by_height & scene.mask) / (by_height.sum() + scene.mask.sum())
    ]
    seen = reordered(extract(scene.mask), depth)
    for number, item in enumerate(seen.instances, start=1):
        if item.length_px < _LEAST_PX:
            continue
        xy = resample(item.centerline_xy, 40)
        started = process_time()
        covered = covered_stretches(seen, number)
        curve = metric_curve(xy, item.width_px, depth, scene.camera, table.sigma_m, covered)
        out["ms"].append(1000 * (process_time() - started))
        if curve is None:
            continue
        true = scene.curves_m[_which(scene, xy)]
        # An instance that goes on along another cable is no error of the depth: such points are
        # counted apart.
        on = np.linalg.norm(xy[:, None] - scene.camera.project(true), axis=2).min(1) < _ASTRAY_PX
        out["astray"] += (~on).astype(float).tolist()
        if not on.any():
            continue
        off, xy = _offsets(curve.points_m, true)[on], xy[on]
        out["error"] += (1000 * np.linalg.norm(off, axis=1)).tolist()
        inverse = np.linalg.pinv(curve.covariance_m2[on], rcond=1e-6, hermitian=True)
        out["inside"] += (
            (np.einsum("ni,nij,nj->n", off, inverse, off) < _NINETY).astype(float).tolist()
        )
        out["raw"] += _raw(xy, depth, scene, true)
        out["radius"].append(abs(curve.radius_m / params.radius_m - 1))
    out["order"] = _order(seen, scene)
    return out


def _which(scene: DepthScene, xy: np.ndarray) -> int:
    lines = [scene.camera.project(curve)[::10] for curve in scene.curves_m]
    return int(
        np.argmin([np.median(np.linalg.norm(xy[:, None] - line, axis=2).min(1)) for line in lines])
    )


def _offsets(points: np.ndarray, true: np.ndarray) -> np.ndarray:
    """(n, 3) from the nearest point of the axis to each of ``points``, without what is along it."""
    nearest = np.linalg.norm(points[:, None] - true, axis=2).argmin(1)
    tangent = np.gradient(true, axis=0)[nearest]
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    off = points - true[nearest]
    return np.asarray(off - (off * tangent).sum(1)[:, None] * tangent)


def _raw(xy: np.ndarray, depth: np.ndarray, scene: DepthScene, true: np.ndarray) -> list[float]:
    values = read_nearest(depth, xy)
    known = np.isfinite(values)
    points = scene.camera.rays(xy[known]) * values[known, None]
    return (1000 * np.linalg.norm(_offsets(points, true), axis=1)).tolist() if known.any() else []


def _order(seen: Scene, scene: DepthScene) -> list[float]:
    """Of every crossing of two cables: whether the upper one is the one that the scene shows
    there."""
    out = []
    for crossing in seen.crossings:
        x, y = np.rint(crossing.xy).astype(int)
        top = int(scene.owner[y, x])
        over, under = (
            _which(scene, seen.instances[p.instance - 1].centerline_xy) + 1
            for p in (crossing.over, crossing.under)
        )
        if over != under and top in (over, under):
            out.append(float(over == top))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--sigma-mm", type=float, default=1.0)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    sensor = SensorParams(sigma_m=args.sigma_mm / 1000)
    all_of: dict[str, list[float]] = {}
    first = 0 if args.tuning else _REPORTED
    for seed in range(first, first + args.scenes):
        for name, values in measure(seed, DepthSceneParams(), sensor).items():
            all_of.setdefault(name, []).extend(values)
    report = {name: round(float(np.mean(values)), 3) for name, values in all_of.items() if values}
    report |= {"scenes": args.scenes, "sigma_mm": args.sigma_mm, "tuning": args.tuning}
    report |= {"points": len(all_of["error"]), "crossings": len(all_of["order"])}
    report["error_p90"] = round(float(np.percentile(all_of["error"], 90)), 3)
    print(json.dumps(report))
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "depth.json").write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
