"""Five crossing cables of one color, each of them the target once: is it the right one that comes
back?

The limits of models/reconstruction/joining.py were settled on the scenes 100 to 129; the benchmark
takes those from 0 on.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.cameras import Camera
from models.geometry.polylines import resample
from models.reconstruction.curves import Curve, distances
from models.reconstruction.reconstruct import (
    NotReconstructable,
    ReconstructParams,
    reconstruct_strand,
)
from models.reconstruction.views import View
from models.synthesis.arm import camera_above
from models.synthesis.views import Cable3D, Scene3D, noise_texture, random_cable
from tests.benchmarks import cable_cell as cell
from workers.stages.outcome import Tools


def identical(held: Tools, scenes: int) -> dict[str, Any]:
    """From exact centerlines with noise, and from pictures."""
    rows: dict[str, Any] = {}
    for name, from_pictures in (("exact centerlines, 0.5 px noise", False), ("pictures", True)):
        right = placed = asked = refused = 0
        covered = 0.0
        for seed in range(scenes):
            scene = five(seed)
            cameras = [camera_above(np.array([x, 0.0]), 0.3) for x in (-0.03, 0.0, 0.03)]
            curves = [c.points_m for c in scene.cables]
            rng = np.random.default_rng(seed)
            views = (
                cell.seen(scene, cameras, held, seed)
                if from_pictures
                else cell.exact(curves, cameras, 0.5, rng)
            )
            for k, curve in enumerate(curves):
                asked += 1
                strand = _strand_at(views[1], curve, [c for j, c in enumerate(curves) if j != k])
                try:
                    found = reconstruct_strand(views, 1, strand, ReconstructParams()).curve
                except NotReconstructable:
                    refused += 1
                    continue
                right += _follows(found, curve, cameras)
                placed += _lies_on(found, curve)
                covered += _covered(found, curve, cameras[1])
        counts = {"asked": asked, "right": right, "placed": placed, "refused": refused}
        rows[name] = counts | {"share": right / asked, "covered": round(covered / asked, 3)}
    return rows


def five(seed: int) -> Scene3D:
    rng = np.random.default_rng(7000 + seed)
    cables = []
    for k in range(5):
        points = random_cable(rng, 0.3, rise_m=0.01)
        turn = rng.uniform(0, np.pi)
        rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        xy = points[:, :2] @ rotation.T + rng.uniform(-0.05, 0.05, 2)
        cables.append(
            Cable3D(
                np.concatenate([xy, points[:, 2:] + 0.004 * k], axis=1), 0.00175, (0.1, 0.2, 0.7)
            )
        )
    return Scene3D(tuple(cables), noise_texture(rng))


def _strand_at(view: View, curve: np.ndarray, others: list[np.ndarray]) -> int:
    """The strand nearest to the pixel of the cable that is farthest from the other cables: what a
    user would click."""
    xy = view.camera.project(curve)
    xy = xy[view.camera.sees(xy, 15.0)]
    rest = np.concatenate([view.camera.project(o) for o in others])
    flat = [np.pad(a, ((0, 0), (0, 1))) for a in (xy, rest)]
    clear = np.min(np.linalg.norm(flat[0][:, None] - flat[1][None, ::10], axis=2), axis=1)
    _, nearest = view.samples.tree.query(xy[np.argmax(clear)])
    return int(view.samples.strand[nearest])


def _follows(found: Curve, truth: np.ndarray, cameras: list[Camera]) -> bool:
    """In every view, nine tenths of the reprojection within 3 px of the target."""
    shares = []
    for camera in cameras:
        seen, true = camera.project(found.points_m), camera.project(cell.dense(truth))
        shares.append(np.mean(cKDTree(true).query(seen)[0] < 3))
    return bool(min(shares) >= 0.9)


def _covered(found: Curve, truth: np.ndarray, camera: Camera) -> float:
    """Share of the target's length in the picture that the reprojection comes within 3 px of."""
    true = camera.project(resample(truth, 1000))
    line = camera.project(found.spline.at(np.linspace(0, 1, 1000)))
    return float(np.mean(cKDTree(line).query(true[camera.sees(true)])[0] < 3))


def _lies_on(found: Curve, truth: np.ndarray) -> bool:
    """Nine tenths of the points within 3 mm or three stated standard deviations of the target."""
    near = distances(found.points_m, cell.dense(truth)) < np.maximum(0.003, 3 * found.sigma_m)
    return bool(near.mean() >= 0.9)
