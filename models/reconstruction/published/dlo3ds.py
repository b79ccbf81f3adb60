"""DLO3DS as published (thesis sections 4.4.2 to 4.5.3): for cameras that slide along their own x
axis.

Strategy: the target is chosen in one view and followed through the others by the slope of its
distance to every spline there (4.4.2). The shortest spline is the reference; the others are sampled
over the same section (4.5.1). A sample's match in another view is where that view's spline crosses
the sample's image row; of several crossings the one nearest to the coarse match, as the samples
before it were matched, is taken. The matched samples are triangulated (eq. 4.1) and a spline is
fitted with the pseudo-inverse of its basis matrix (4.5.2); its reprojection is the measure of
quality (4.5.3). A DLO along the rows, turned cameras and lens distortion beyond what
:class:`Camera` removes are outside its assumptions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.cameras import NEAREST_M, Camera
from models.geometry.polylines import arc_lengths, resample
from models.reconstruction import curves
from models.reconstruction.association import Support
from models.reconstruction.curves import Curve, Spline3D
from models.reconstruction.reconstruct import NotReconstructable, Reconstruction
from models.reconstruction.refinement import across
from models.reconstruction.triangulation import nearest_to_rays
from models.reconstruction.uncertainty import admitted, steepness_in_space
from models.reconstruction.views import View
from models.reconstruction.widths import radius_along

_STEEPEST = 6.0
"""Change of distance, in lengths across the line of sight, from one sample to the next that no DLO
makes."""
_LEAST_STEEP = 0.02
_LEAST_NOISE_PX = 0.17
"""Light and shadow move the edges of a DLO the same way in every picture."""
_NOISE_LEFT = 0.5
"""Share of the noise of the samples that their distance to the fitted curve shows: it follows the
rest."""
_ANYWHERE = 2.0
"""Standard deviation, as a share of the distance, of depth that no view shows."""


@dataclass(frozen=True)
class Dlo3dsParams:
    """``samples``: n_s of the thesis. ``spans`` of the 3D spline. ``turn_rad`` and ``off_row``: how
    far the cameras may be from a normal stereo rig (rotation between them; share of the baseline
    that is not along x)."""

    samples: int = 20
    spans: int = 6
    points: int = 60
    turn_rad: float = 0.01
    off_row: float = 0.05


def reconstruct(
    views: list[View], reference: int, strand: int, params: Dlo3dsParams
) -> Reconstruction:
    """The DLO that is strand ``strand`` in view ``reference``. Raises NotReconstructable."""
    _check_rig(views, params)
    chosen = select(views, reference, strand)
    used = [k for k, number in enumerate(chosen) if number is not None]
    if len(used) < 2:
        raise NotReconstructable(f"the DLO was found in no view but {views[reference].name}")
    lines = [views[k].strands[int(chosen[k] or 0)].xy for k in used]
    matched = match_rows(lines, params.samples)
    rays = np.stack([views[k].camera.rays(xy) for k, xy in zip(used, matched, strict=True)])
    known = np.isfinite(matched).all(axis=2)
    kept = known.sum(axis=0) >= 2
    if kept.sum() < 4:
        raise NotReconstructable(
            "fewer than four samples of the DLO were matched along the image rows"
        )
    centers = np.stack([views[k].camera.center for k in used])
    points = nearest_to_rays(centers, np.nan_to_num(rays, nan=1.0), np.asarray(known, np.float64))
    kept &= np.isfinite(points).all(axis=1) & _in_front(points, [views[k].camera for k in used])
    if kept.sum() < 4:
        raise NotReconstructable(
            "the rays of the matched samples are parallel: the camera has to move farther"
        )
    _check_course(points[kept], centers)
    spline = _pseudo_inverse_fit(points[kept], min(params.spans, int(kept.sum()) - 3))
    return _reconstruction(
        spline, views, chosen, matched[:, kept], used, (reference, strand), params
    )


def select(views: list[View], reference: int, strand: int) -> list[int | None]:
    """The target's strand in every view (4.4.2): going away from ``reference``, the strand whose
    distance to the one before changes the least along it."""
    chosen: list[int | None] = [None] * len(views)
    chosen[reference] = strand
    for order in (range(reference + 1, len(views)), range(reference - 1, -1, -1)):
        before = views[reference].strands[strand].xy
        for k in order:
            if not views[k].strands:
                continue
            slopes = [_slope(before, s.xy) for s in views[k].strands]
            chosen[k] = int(np.argmin(slopes))
            before = views[k].strands[int(np.argmin(slopes))].xy
    return chosen


def _slope(target: FloatArray, other: FloatArray) -> float:
    """Absolute slope of the line through the point-to-point distances; the other's direction is
    free."""
    count = 20
    u = np.linspace(0, 1, count)
    a, b = resample(target, count), resample(other, count)
    distances = [np.hypot(*(a - c).T) for c in (b, b[::-1])]
    straight = min(distances, key=lambda d: float(d.mean()))
    return abs(float(np.polyfit(u, straight, 1)[0]))


def match_rows(lines: list[FloatArray], count: int) -> FloatArray:
    """(k, count, 2) matched samples of k polylines (n, 2), NaN where a view has no crossing with
    the row."""
    spans = [float(np.hypot(*np.diff(xy, axis=0).T).sum()) for xy in lines]
    r = int(np.argmin(spans))
    reference = lines[r]
    u = np.linspace(0, 1, count)
    samples = resample(reference, count)
    out = np.full((len(lines), count, 2), np.nan)
    for i, line in enumerate(lines):
        if i == r:
            out[i] = samples
            continue
        same_way = np.hypot(*(line[0] - reference[0])) <= np.hypot(*(line[-1] - reference[0]))
        towards = line if same_way else line[::-1]
        # u_i <- u l_r / l_i + d(q_i(0), q_r(0)) / l_i: the printed l_i / l_r would sample past the
        # end
        shift = abs(float(towards[0, 1] - reference[0, 1])) / spans[i]
        coarse = np.clip(u * spans[r] / spans[i] + shift, 0, 1)
        out[i] = _along_rows(samples, towards, coarse)
    return out


def _along_rows(samples: FloatArray, line: FloatArray, coarse: FloatArray) -> FloatArray:
    off = line[None, :, 1] - samples[:, 1, None]
    row, column = np.nonzero((off[:, :-1] * off[:, 1:] <= 0) & (off[:, :-1] != off[:, 1:]))
    share = off[row, column] / (off[row, column] - off[row, column + 1])
    place = (column + share) / (len(line) - 1)
    out, drift = np.full(samples.shape, np.nan), 0.0
    for j in range(len(samples)):
        mine = np.flatnonzero(row == j)
        if not len(mine):
            continue
        best = mine[np.argmin(np.abs(place[mine] - coarse[j] - drift))]
        drift = float(place[best] - coarse[j])
        out[j] = line[column[best]] + share[best] * (line[column[best] + 1] - line[column[best]])
    return out


def _in_front(points: FloatArray, cameras: list[Camera]) -> BoolArray:
    """(n,) whether points lie in front of all cameras; those that are NaN do not."""
    out: BoolArray = np.all(
        [camera.in_camera(points)[:, 2] > NEAREST_M for camera in cameras], axis=0
    )
    return out


def _check_course(points: FloatArray, centers: FloatArray) -> None:
    """Raises NotReconstructable where neighboring samples are so far apart in depth that a row was
    matched with another part of the DLO, as it is for one that runs along the rows."""
    distance = np.linalg.norm(points - centers.mean(axis=0), axis=1)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not steps.sum() > 0:
        raise NotReconstructable("the matched samples all lie at one place")
    leaps = np.abs(np.diff(distance)) > _STEEPEST * np.sqrt(
        np.maximum(steps**2 - np.diff(distance) ** 2, 0)
    )
    if leaps.any():
        raise NotReconstructable(
            "the DLO runs along the image rows, so that this method finds no depth: move the camera across the DLO, "
            "or take the default method"
        )


def _pseudo_inverse_fit(points: FloatArray, spans: int) -> Spline3D:
    along = arc_lengths(points)
    knots = curves.clamped_knots(max(spans, 1))
    matrix = curves.basis(knots, along / along[-1])
    return Spline3D(knots, np.linalg.pinv(matrix) @ points)


def _reconstruction(
    spline: Spline3D,
    views: list[View],
    chosen: list[int | None],
    matched: FloatArray,
    used: list[int],
    source: tuple[int, int],
    params: Dlo3dsParams,
) -> Reconstruction:
    """Reprojection on each view (4.5.3), and the depth error that follows from it (eq. 4.2) as
    covariance."""
    parameters = curves.at_equal_lengths(spline, params.points)
    points = spline.at(parameters)
    strands = [np.array([] if c is None else [c], np.int64) for c in chosen]
    supports = []
    for k in range(len(views)):
        if k not in used:
            supports.append(Support("not_found", (), 0.0, float("nan")))
            continue
        seen = matched[used.index(k)]
        seen = seen[np.isfinite(seen).all(axis=1)]
        if not len(seen):  # nothing of the curve was matched in this view
            supports.append(Support("not_found", (), 0.0, float("nan")))
            continue
        dense = views[k].camera.project(spline.at(np.linspace(0, 1, 400)))
        errors = curves.distances(np.pad(seen, ((0, 0), (0, 1))), np.pad(dense, ((0, 0), (0, 1))))
        supports.append(Support("used", (int(chosen[k] or 0),), 1.0, float(errors.mean())))
    reprojection = float(np.mean([s.reprojection_px for s in supports if s.verdict == "used"]))
    noise = max(reprojection / _NOISE_LEFT, _LEAST_NOISE_PX)
    covariance = across(
        _ray_covariance(points, [views[k].camera for k in used], noise), spline.tangents(parameters)
    )
    radius, sigma = radius_along(points, views, strands)
    curve = Curve(spline, points, covariance, radius, sigma)
    return Reconstruction(curve, tuple(supports), source[0], source[1], noise, reprojection)


def _ray_covariance(points: FloatArray, cameras: list[Camera], noise_px: float) -> FloatArray:
    """(n, 3, 3) of single points seen with ``noise_px`` in every view; it grows as the DLO turns to
    the rows."""
    information = np.zeros((len(points), 3, 3))
    noise = noise_px / np.maximum(steepness_in_space(points, cameras), _LEAST_STEEP)
    for camera in cameras:
        ray = points - camera.center
        depth = np.maximum(camera.in_camera(points)[:, 2], NEAREST_M)
        unit = ray / np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), NEAREST_M)
        spread = (camera.focal_px / (noise * depth)) ** 2
        information += spread[:, None, None] * (np.eye(3) - unit[:, :, None] * unit[:, None])
    distance = np.min([np.linalg.norm(points - c.center, axis=1) for c in cameras], axis=0)
    least = np.eye(3) / (_ANYWHERE * np.maximum(distance, NEAREST_M))[:, None, None] ** 2
    return admitted(np.linalg.inv(information + least), points, cameras)


def _check_rig(views: list[View], params: Dlo3dsParams) -> None:
    first = views[0].camera
    for view in views[1:]:
        turn = np.arccos(
            np.clip((np.trace(first.rotation.T @ view.camera.rotation) - 1) / 2, -1, 1)
        )
        step = first.rotation.T @ (view.camera.center - first.center)
        if turn > params.turn_rad or np.linalg.norm(step[1:]) > params.off_row * abs(step[0]):
            raise NotReconstructable(
                "method dlo3ds needs cameras that slide along their x axis without turning; "
                f"{view.name} does not. The default method takes any poses"
            )
