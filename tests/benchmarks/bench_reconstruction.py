"""The 3D reconstruction against exact truth (thesis section 4.6.1 and beyond).

``python -m tests.benchmarks.bench_reconstruction [SHARED] [--only exact,sections,…] [--cables
10]``: each part prints its rows and is written to ``build/bench/reconstruction.json``, where the
parts not run this time are kept.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from dlo_client.errors import JobFailed
from dlo_client.scan import Scan, ScanOptions
from scipy.spatial import cKDTree

from models.geometry.polylines import resample
from models.reconstruction.curves import Curve, distances
from models.reconstruction.matching import MatchParams, match
from models.reconstruction.published import dlo3ds
from models.reconstruction.reconstruct import (
    NotReconstructable,
    Reconstruction,
    ReconstructParams,
    reconstruct_all,
    reconstruct_strand,
)
from models.reconstruction.triangulation import nearest_to_rays
from models.reconstruction.uncertainty import covers
from models.reconstruction.view_planning import Optimise, PlanParams, plan_views
from models.reconstruction.views import View
from models.synthesis.arm import SimulatedArm, camera_above
from models.synthesis.views import Scene3D, random_cable, render
from tests.benchmarks import cable_cell as cell
from tests.benchmarks import census_sgm, five_cables
from tests.benchmarks.camera_rigs import RIGS
from workers.stages.outcome import Tools

PARAMS = ReconstructParams()
INDEPENDENT = ReconstructParams(shared_px=0.0, stray=0.0)
"""For noise that is drawn anew for every point and view: nothing is shared, nothing strays."""

NOISE_PX = 0.5
LIMITS = PlanParams(nearest_m=0.15, baseline_at_most_m=0.15, least_visible=0.5)
Rows = dict[str, Any]


def score(
    curves: list[Curve], truths: list[np.ndarray], units_mm: list[float] | None = None
) -> Rows:
    """Means over the curves: distance to the truth in mm (mean, and the mean of the 95th
    percentiles), stated standard deviation, coverage of the stated 90 % ellipsoids."""
    errors = [
        1000 * distances(c.points_m, cell.dense(t)) for c, t in zip(curves, truths, strict=True)
    ]
    rows = {
        "n": len(curves),
        "error_mm": np.mean([e.mean() for e in errors]),
        "p95_mm": np.mean([np.percentile(e, 95) for e in errors]),
        "stated_mm": 1000 * np.mean([c.sigma_m.mean() for c in curves]),
        "coverage": np.mean(
            [covers(c, cell.dense(t), 0.9).mean() for c, t in zip(curves, truths, strict=True)]
        ),
    }
    if units_mm is not None:
        rows["in_units"] = np.mean([e.mean() / u for e, u in zip(errors, units_mm, strict=True)])
    return rounded(rows)


def rounded(rows: Rows) -> Rows:
    return {k: round(float(v), 4) if isinstance(v, float) else v for k, v in rows.items()}


def exact(cables: int) -> Rows:
    """Exact centerlines with half a pixel of noise, three views 25 mm apart: four ways to match
    them."""
    found: dict[str, list[np.ndarray]] = {"arc length": [], "epipolar DP": [], "dlo3ds": []}
    truths, units, bundled = [], [], []
    for seed in range(3 * cables):
        truth = random_cable(np.random.default_rng(1000 + seed), 0.22, rise_m=0.03)
        cameras = [camera_above(np.array([x, 0.0]), cell.DISTANCE_M) for x in (-0.025, 0.0, 0.025)]
        views = cell.exact([truth], cameras, NOISE_PX, np.random.default_rng(seed))
        depth = cell.DISTANCE_M - truth[:, 2].mean()
        truths.append(truth)
        units.append(1000 * depth**2 * NOISE_PX / (600 * 0.05))
        found["arc length"].append(_by_arc_length(views))
        found["epipolar DP"].append(_by_matching(views, 40))
        found["dlo3ds"].append(
            dlo3ds.reconstruct(views, 1, 0, dlo3ds.Dlo3dsParams()).curve.points_m
        )
        bundled.append(reconstruct_strand(views, 1, 0, INDEPENDENT).curve)
    rows: Rows = {
        name: {
            "in_units": round(
                float(
                    np.mean(
                        [_units(p, t, u) for p, t, u in zip(points, truths, units, strict=True)]
                    )
                ),
                3,
            )
        }
        for name, points in found.items()
    }
    rows["spline_bundle"] = score(bundled, truths, units)
    return rows


def _units(points: np.ndarray, truth: np.ndarray, unit_mm: float) -> float:
    return float(1000 * distances(points, cell.dense(truth)).mean() / unit_mm)


def _by_arc_length(views: list[View]) -> np.ndarray:
    lines = np.stack([resample(v.strands[0].xy, 40) for v in views])
    rays = np.stack([v.camera.rays(xy) for v, xy in zip(views, lines, strict=True)])
    return nearest_to_rays(np.stack([v.camera.center for v in views]), rays)


def _by_matching(views: list[View], count: int) -> np.ndarray:
    strand, camera = views[1].strands[0], views[1].camera
    index = np.linspace(0, len(strand.xy) - 1, count).astype(int)
    matched = match(views[1], strand, index, [views[0], views[2]], MatchParams())
    good = matched.found
    return camera.center + matched.depth[good, None] * camera.rays(strand.xy[index[good]])


def sections(held: Tools, cables: int) -> Rows:
    """One section at the middle of each cable, RGB to curve: diameters, numbers of views,
    optimisation, methods."""
    rows: Rows = {}
    truths = [cell.cable_scene(seed).cables[0].points_m for seed in range(cables)]
    for diameter in (2.0, 3.5, 5.0):
        scenes = [cell.cable_scene(seed, diameter / 1000) for seed in range(cables)]
        views = [cell.seen(s, cell.row(s), held, k) for k, s in enumerate(scenes)]
        found = [_longest(v) for v in views]
        rows[f"diameter {diameter} mm"] = _section_row(found, truths) | _radii(found, diameter)
        if diameter == 3.5:
            rows["dlo3ds"] = _section_row([_longest(v, "dlo3ds") for v in views], truths)
            rows["2 views"] = _section_row([_longest(v[:2]) for v in views], truths)
            first = found
    scenes = [cell.cable_scene(seed) for seed in range(cables)]
    views = [cell.seen(s, cell.row(s, 5), held, k) for k, s in enumerate(scenes)]
    rows["5 views"] = _section_row([_longest(v) for v in views], truths)
    rows["4 views"] = _section_row([_longest(v[:4]) for v in views], truths)
    modes: tuple[Optimise, ...] = ("b", "z", "bz")
    for mode in modes:
        better = [
            _better(s, f.curve, held, mode, k)
            for k, (s, f) in enumerate(zip(scenes, first, strict=True))
        ]
        rows[f"optimised {mode}"] = _section_row(better, truths)
    return rows


def _section_row(found: list[Reconstruction], truths: list[np.ndarray]) -> Rows:
    reprojection = round(float(np.mean([f.reprojection_px for f in found])), 3)
    return score([f.curve for f in found], truths) | {"reprojection_px": reprojection}


def _better(scene: Scene3D, curve: Curve, held: Tools, mode: Optimise, seed: int) -> Reconstruction:
    """The same section from the poses that the planning asks for; the fixed baseline where it is
    not optimised."""
    cameras = cell.row(scene)
    plan = plan_views(
        curve, cameras, replace(LIMITS, optimise=mode, baseline_m=2 * cell.BASELINE_M)
    )
    moved = [replace(cameras[0], T_world_camera=pose) for pose in plan.poses]
    return _longest(cell.seen(scene, moved, held, seed + 500))


def _longest(views: list[View], method: str = "spline_bundle") -> Reconstruction:
    if method == "spline_bundle":
        return reconstruct_all(views, PARAMS)[0]
    middle = len(views) // 2
    strand = int(np.argmax([s.length_px for s in views[middle].strands]))
    return dlo3ds.reconstruct(views, middle, strand, dlo3ds.Dlo3dsParams())


def _radii(found: list[Reconstruction], diameter_mm: float) -> Rows:
    off = [2000 * f.curve.mean_radius_m / diameter_mm - 1 for f in found]
    return {"radius_off": round(float(np.mean(np.abs(off))), 3)}


OPTIMISED = {
    "b + z": (3.5, ScanOptions(nearest_m=0.15)),
    "fixed": (3.5, ScanOptions(optimise="fixed")),
    "b": (3.5, ScanOptions(optimise="b")),
    "z": (3.5, ScanOptions(optimise="z", nearest_m=0.15)),
}
VARIED = {
    "b + z, 2 views": (3.5, ScanOptions(nearest_m=0.15, views=2)),
    "b + z, 4 views": (3.5, ScanOptions(nearest_m=0.15, views=4)),
    "b + z, 5 views": (3.5, ScanOptions(nearest_m=0.15, views=5)),
    "b + z, overlap 0.3": (3.5, ScanOptions(nearest_m=0.15, overlap=0.3)),
    "b + z, overlap 0.7": (3.5, ScanOptions(nearest_m=0.15, overlap=0.7)),
    "b + z, diameter 2.0 mm": (2.0, ScanOptions(nearest_m=0.15)),
    "b + z, diameter 5.0 mm": (5.0, ScanOptions(nearest_m=0.15)),
}
"""Diameter in mm and options: thesis section 4.6.1, one parameter at a time around its defaults
(3.5 mm, 3 views, 50 % overlap, b + z). The varied ones are scanned on the first three tenths of the
cables: they take the longest."""


def scans(held: Tools, cables: int, keep: Callable[[Rows], None]) -> Rows:
    """Whole cables of 0.8 m with Scan: section by section, merged; both directions of the error.
    ``keep`` gets the rows that are there already."""
    rows: Rows = {}
    for name, (diameter, options) in (OPTIMISED | VARIED).items():
        count = cables if name in OPTIMISED else max(3 * cables // 10, 1)
        rows[name] = _scan_all(held, count, diameter, options)
        keep(rows)
    return rows


def _scan_all(held: Tools, cables: int, diameter_mm: float, options: ScanOptions) -> Rows:
    forth, back, reprojection, counts, thicker = [], [], [], [], []
    failed = 0
    for seed in range(cables):
        scene = cell.cable_scene(seed, diameter_mm / 1000)
        truth = scene.cables[0].points_m
        arm = SimulatedArm(
            scene, camera_above(truth[len(truth) // 2, :2], 0.3), np.random.default_rng(seed)
        )
        try:
            result = Scan(cell.InProcess(held), arm, options).run()
        except JobFailed:
            failed += 1
            continue
        points = np.array(result.curve.points_m)
        forth.append(1000 * distances(points, cell.dense(truth)))
        back.append(1000 * distances(truth[::5], points).mean())
        reprojection.append(np.mean([s.result.reprojection_px for s in result.sections]))
        counts.append(len(result.sections))
        radii = [
            s.result.curve.radius_m for s in result.sections if s.result.curve.radius_m is not None
        ]
        thicker.append(2000 * np.median(radii) / diameter_mm - 1)
    if not forth:
        return {"n": cables, "failed": failed, "whole": 0}
    quartiles = np.percentile(np.concatenate(forth), [25, 75])
    means = {
        "error_mm": np.mean([e.mean() for e in forth]),
        "q1_mm": quartiles[0],
        "q3_mm": quartiles[1],
    }
    means |= {
        "missing_mm": np.mean(back),
        "reprojection_px": np.mean(reprojection),
        "sections": np.mean(counts),
    }
    means["thicker"] = np.mean(thicker)
    return rounded(
        means | {"n": cables, "failed": failed, "whole": int(np.sum(np.array(back) < 2))}
    )


def rigs(held: Tools, cables: int) -> Rows:
    """Cameras that no normal stereo rig has, and a DLO along the baseline; the published method
    beside it."""
    rows: Rows = {}
    for name, change in RIGS.items():
        curves, truths, failed = [], [], 0
        for seed in range(cables):
            scene = cell.cable_scene(seed)
            views = cell.seen(scene, change(cell.row(scene)), held, seed)
            curves.append(_longest(views).curve)
            truths.append(scene.cables[0].points_m)
            try:
                other = _longest(views, "dlo3ds").curve
                failed += int(1000 * distances(other.points_m, cell.dense(truths[-1])).mean() > 5)
            except NotReconstructable:
                failed += 1
        rows[name] = score(curves, truths) | {"dlo3ds_fails": failed}
    return rows


def stereo(held: Tools, shared: Path) -> Rows:
    """Depth of the cable's pixels as in Fig. 4.8: 25 mm baseline, semi-global matching on two
    views, ours on three."""
    rows: Rows = {}
    grounds: dict[str, np.ndarray | None] = {"speckled": None, **cell.textures(shared)}
    for diameter in (2.0, 3.5, 5.0):
        errors: dict[str, list[np.ndarray]] = {
            "spline_bundle": [],
            "census SGM": [],
            "OpenCV SGBM": [],
        }
        for number, ground in enumerate(grounds.values()):
            scene = cell.cable_scene(number, diameter / 1000, ground)
            cameras = cell.row(scene)
            shots = [render(scene, c, np.random.default_rng(k)) for k, c in enumerate(cameras)]
            on = (shots[1].ids == 1) & (np.arange(640)[None] > 90)
            truth = shots[1].depth_m[on]
            grays = [cv2.cvtColor(s.rgb, cv2.COLOR_RGB2GRAY) for s in shots]
            for name, matcher in (
                ("census SGM", census_sgm.disparity),
                ("OpenCV SGBM", census_sgm.opencv),
            ):
                depth = 600 * cell.BASELINE_M / matcher(grays[1], grays[2], 96)
                errors[name].append(1000 * np.abs(depth[on] - truth))
            curve = _longest(cell.seen(scene, cameras, held, number)).curve
            errors["spline_bundle"].append(
                1000 * np.abs(_tube_depth(curve, cameras[1], on) - truth)
            )
        for name, values in errors.items():
            every = np.concatenate(values)
            known = every[np.isfinite(every)]
            rows[f"{diameter} mm, {name}"] = rounded(
                {
                    "median_mm": np.median(known),
                    "p90_mm": np.percentile(known, 90),
                    "answered": np.mean(np.isfinite(every)),
                }
            )
    return rows


def _tube_depth(curve: Curve, camera: Any, on: np.ndarray) -> np.ndarray:
    """Depth of the nearest surface of the curve's tube at every pixel of ``on``."""
    points = curve.spline.at(np.linspace(0, 1, 3000))
    xy, depth = camera.project(points), camera.in_camera(points)[:, 2]
    rows, columns = np.nonzero(on)
    pixels = np.stack([columns, rows], axis=1).astype(float)
    off, nearest = cKDTree(xy).query(pixels)
    half = curve.mean_radius_m * camera.focal_px / depth[nearest]
    return depth[nearest] - curve.mean_radius_m * np.sqrt(np.clip(1 - (off / half) ** 2, 0, 1))


def timings() -> Rows:
    """Processor time of one thread in ms, best and median of 40: matching and triangulation; with
    refinement."""
    truth = random_cable(np.random.default_rng(1000), 0.22, rise_m=0.03)
    cameras = [camera_above(np.array([x, 0.0]), cell.DISTANCE_M) for x in (-0.025, 0.0, 0.025)]
    views = cell.exact([truth], cameras, NOISE_PX, np.random.default_rng(0))
    rows: Rows = {}
    for count in (10, 20, 40):
        rows[f"matching and triangulation, {count} points"] = _timed(
            lambda n=count: _by_matching(views, n)
        )
    rows["whole reconstruction of one DLO"] = _timed(
        lambda: reconstruct_strand(views, 1, 0, PARAMS)
    )
    rows["dlo3ds, 20 points"] = _timed(
        lambda: dlo3ds.reconstruct(views, 1, 0, dlo3ds.Dlo3dsParams())
    )
    return rows


def _timed(work: Callable[[], Any]) -> Rows:
    took = []
    for _ in range(40):
        started = time.thread_time()
        work()
        took.append(1000 * (time.thread_time() - started))
    return {"best_ms": round(min(took), 2), "median_ms": round(float(np.median(took)), 2)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--only", default="")
    parser.add_argument("--cables", type=int, default=10)
    parser.add_argument("--out", type=Path, default=Path("build/bench/reconstruction.json"))
    args = parser.parse_args()
    held = cell.tools()
    args.out.parent.mkdir(parents=True, exist_ok=True)
    data = json.loads(args.out.read_text()) if args.out.exists() else {}

    def keep(name: str, rows: Rows) -> None:
        data[name] = rows
        args.out.write_text(json.dumps(data, indent=1, default=float))

    parts: dict[str, Callable[[], Rows]] = {
        "timings": timings,
        "exact": lambda: exact(args.cables),
        "sections": lambda: sections(held, args.cables),
        "identical": lambda: five_cables.identical(held, 2 * args.cables),
        "rigs": lambda: rigs(held, args.cables),
        "stereo": lambda: stereo(held, args.shared),
        "scans": lambda: scans(held, args.cables, lambda rows: keep("scans", rows)),
    }
    for name, part in parts.items():
        if args.only and name not in args.only.split(","):
            continue
        keep(name, part())
        for row, values in data[name].items():
            print(f"{name:10} {row:44} {values}", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
