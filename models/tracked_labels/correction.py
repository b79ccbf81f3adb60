"""Moving projected strokes onto the DLOs in the pictures (thesis 2.5.3), so that all corrections
agree.

Strategy: the thesis corrects every point of every view by itself. But a correction has causes that
many points share: the calibration shifts a whole view, the tracker all strokes, the hand one point
of a stroke in all views. So corrections are read from the crops three times. First every point
votes by itself, within the whole crop and two more beside it: it may be off by more than the
corrector has learnt to bridge. The votes are explained by a shift of all strokes, a smooth 3D
displacement of each, common to all views, and a small motion of each view; a robust least squares
leaves out the votes that fit none of them. The explained line is where the next crops are taken,
and what it predicts is, with a spread that shrinks, what their lines of probability are weighted
with. Each time the best path along the lines' probabilities is taken (one column a crop, neighbors
near one another).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.ndimage import gaussian_filter1d

from models.geometry.arrays import ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.cameras import Camera
from models.tracked_labels.crops import across_xy, pixels_per_crop_pixel, upright_crops
from models.tracked_labels.lines import LineReading, read_lines_at, side_by_side, weighed
from models.tracked_labels.strokes import ProjectedStroke, project_stroke, stretches

CropReader = Callable[[ByteArray], tuple[Float32Array, Float32Array]]
"""(n, SIZE, SIZE, 3) crops to (n, SIZE) column probabilities and (n, SIZE) widths: the corrector
network."""

FIRST_SPREAD_PX = 18.0
"""How far (standard deviation, pixels of the crop) a stroke may be off before anything is
corrected."""
_LEAST_TRUST = 0.3
"""A crop that shows nothing has some trust in its middle, and would hold its view where it was
believed to be."""
_REWEIGHTED = 5
_STEP_M = 1e-4
_OUTLIER_PX = 2.0
"""A vote that is so far off what all explain counts half (Cauchy)."""


@dataclass(frozen=True)
class CorrectionParams:
    """``spread_px``: how far (crop pixels, standard deviation) a line may be off in each round;
    ``aside_px``: where two more crops are taken in the first round, to either side (0: none);
    ``per_control``: samples of the stroke for one control point of its 3D displacement;
    ``stiffness`` of that displacement's bending; ``bend``: cost of one pixel of change between
    neighboring crops; ``agree`` off: every view and point by itself, as the thesis has it."""

    spread_px: tuple[float, ...] = (FIRST_SPREAD_PX, 6.0, 3.5)
    aside_px: int = 24
    per_control: int = 6
    stiffness: float = 0.3
    bend: float = 0.35
    smooth: float = 1.5
    agree: bool = True


@dataclass(frozen=True, eq=False)
class CorrectedStroke:
    """One stroke in one view: ``xy`` (n, 2) corrected pixels (NaN where the sample is out of the
    picture), ``offset_px`` (n,) how far each was moved across the DLO, ``trust`` (n,) 0 to 1,
    ``width_px`` (n,) as read from the crops, ``depth_m`` (n,)."""

    xy: FloatArray
    offset_px: FloatArray
    trust: FloatArray
    width_px: FloatArray
    depth_m: FloatArray


def correct_strokes(
    images: Sequence[ByteArray],
    cameras: Sequence[Camera],
    strokes: Sequence[FloatArray],
    thickness_m: Sequence[float],
    reader: CropReader,
    params: CorrectionParams,
) -> list[list[CorrectedStroke]]:
    """Per view, per stroke. ``strokes``: (n, 3) samples as :func:`smooth_stroke` gives them."""
    moved = [np.zeros_like(points) for points in strokes]
    shifts = [np.zeros(4) for _ in cameras]
    votes: list[list[_Votes]] = []
    for k, spread in enumerate(params.spread_px):
        last = k == len(params.spread_px) - 1
        votes = [
            [
                _vote(
                    image,
                    camera,
                    points + move,
                    shift,
                    thick,
                    reader,
                    spread,
                    0 if k else params.aside_px,
                    params,
                )
                for points, move, thick in zip(strokes, moved, thickness_m, strict=True)
            ]
            for image, camera, shift in zip(images, cameras, shifts, strict=True)
        ]
        if params.agree and not last:
            moved, shifts = _explain(cameras, strokes, moved, shifts, votes, params)
    drawn = [[project_stroke(points, camera) for points in strokes] for camera in cameras]
    return [
        [_settled(vote, start, params) for vote, start in zip(row, starts, strict=True)]
        for row, starts in zip(votes, drawn, strict=True)
    ]


@dataclass(frozen=True, eq=False)
class _Votes:
    """Of ``n`` samples in one view: where the line was taken to be, its normals, and what the crops
    gave."""

    xy: FloatArray
    normal: FloatArray
    offset: FloatArray
    trust: FloatArray
    width: FloatArray
    depth: FloatArray


def _vote(
    image: ByteArray,
    camera: Camera,
    points_m: FloatArray,
    shift: FloatArray,
    thickness_m: float,
    reader: CropReader,
    spread: float,
    aside: int,
    params: CorrectionParams,
) -> _Votes:
    seen = project_stroke(points_m, camera)
    xy = _shifted(seen.xy, shift, camera)
    n = len(points_m)
    votes = _Votes(
        xy, np.full((n, 2), np.nan), np.zeros(n), np.zeros(n), np.full(n, np.nan), seen.depth_m
    )
    for run in stretches(seen.inside):
        tangent = np.gradient(xy[run], axis=0)
        believed = thickness_m * camera.focal_px / seen.depth_m[run]
        scale = pixels_per_crop_pixel(believed)
        probability, widths = _look(image, xy[run], tangent, scale, reader, aside)
        reading = _read(probability, widths, believed / scale, spread, params)
        votes.normal[run] = across_xy(tangent)
        votes.offset[run] = reading.offsets * scale
        votes.trust[run] = reading.trust
        votes.width[run] = reading.widths * scale
    return votes


def _look(
    image: ByteArray,
    xy: FloatArray,
    tangent: FloatArray,
    scale: FloatArray,
    reader: CropReader,
    aside: int,
) -> tuple[Float32Array, Float32Array]:
    """(n, columns) probabilities and widths at points of one line, with crops ``aside`` too."""
    places = (-aside, 0, aside) if aside else (0,)
    across = across_xy(tangent) * scale[:, None]
    seen = [reader(upright_crops(image, xy + place * across, tangent, scale)) for place in places]
    columns, widths = zip(*seen, strict=True)
    return side_by_side(columns, max(aside, 1)), side_by_side(widths, max(aside, 1))


def _read(
    probability: Float32Array,
    widths: Float32Array,
    believed: FloatArray,
    spread: float,
    params: CorrectionParams,
) -> LineReading:
    """Columns weighted by how far they are and how well their width fits; with neighbors in
    agreement."""
    evidence = weighed(probability, widths, believed, spread)
    path = best_path(evidence, params.bend) if params.agree else evidence.argmax(1)
    reading = read_lines_at(probability, widths, path)
    # A line that the prior alone has chosen shows nothing.
    likely = np.exp(evidence - evidence.max(1, keepdims=True))
    share = likely[np.arange(len(path)), path] / likely.sum(1)
    return LineReading(reading.offsets, reading.widths, reading.trust * np.minimum(1.0, 4 * share))


def best_path(evidence: FloatArray, bend: float) -> IntArray:
    """(n,) column of each of ``n`` crops, so that the sum of ``evidence`` (n, c) less ``bend``
    times the squared steps between neighbors is greatest."""
    columns = np.arange(evidence.shape[1])
    step = bend * np.minimum((columns[:, None] - columns) ** 2, 64)
    score = evidence[0].copy()
    back = np.zeros(evidence.shape, np.int64)
    for k in range(1, len(evidence)):
        options = score[:, None] - step
        back[k] = options.argmax(0)
        score = options[back[k], columns] + evidence[k]
    path = np.zeros(len(evidence), np.int64)
    path[-1] = int(score.argmax())
    for k in range(len(evidence) - 1, 0, -1):
        path[k - 1] = back[k, path[k]]
    return path


def _explain(
    cameras: Sequence[Camera],
    strokes: Sequence[FloatArray],
    moved: Sequence[FloatArray],
    shifts: Sequence[FloatArray],
    votes: Sequence[Sequence[_Votes]],
    params: CorrectionParams,
) -> tuple[list[FloatArray], list[FloatArray]]:
    """The displacement (n, 3) of every stroke and the motion (4,) of every view that explain the
    votes.

    Unknowns: control points of the displacements, a shift (3) of all strokes, and for each view a
    shift in x and y, a turn and a growth about the picture's middle. What a stroke shows across
    itself so moves the others along themselves. One linear equation a vote: its offset along its
    normal.
    """
    bases = [_basis(len(points), params.per_control) for points in strokes]
    starts = np.concatenate(([0], np.cumsum([3 * b.shape[1] for b in bases])))
    shared = slice(int(starts[-1]), int(starts[-1]) + 3)
    size = shared.stop + 4 * len(cameras)
    rows, values, weights = [], [], []
    for v, (camera, row) in enumerate(zip(cameras, votes, strict=True)):
        for s, vote in enumerate(row):
            use = np.flatnonzero((vote.trust > _LEAST_TRUST) & np.isfinite(vote.normal[:, 0]))
            normal = vote.normal[use]
            along = np.einsum("ni,nij->nj", normal, _jacobian(camera, (strokes[s] + moved[s])[use]))
            block = np.zeros((len(use), size))
            part = block[:, starts[s] : starts[s + 1]]
            part[:] = (bases[s][use][:, :, None] * along[:, None]).reshape(part.shape)
            block[:, shared] = along
            first = shared.stop + 4 * v
            block[:, first : first + 4] = np.einsum(
                "ni,nij->nj", normal, _motions(vote.xy[use], camera)
            )
            rows.append(block)
            values.append(vote.offset[use])
            weights.append(vote.trust[use])
    solution = _robust_solution(
        np.concatenate(rows),
        np.concatenate(values),
        np.concatenate(weights),
        _prior(bases, starts, size, params),
    )
    displaced = [
        m + basis @ solution[a:b].reshape(-1, 3) + solution[shared]
        for m, basis, a, b in zip(moved, bases, starts[:-1], starts[1:], strict=True)
    ]
    return displaced, [
        shift + solution[shared.stop + 4 * v :][:4] for v, shift in enumerate(shifts)
    ]


def _robust_solution(
    matrix: FloatArray, wanted: FloatArray, trust: FloatArray, prior: FloatArray
) -> FloatArray:
    """Least squares of V votes: ``matrix`` (V, unknowns) times the solution is to be ``wanted``
    (V,), each as its ``trust`` (V,) counts and less the further off it stays; ``prior``: inverse
    variances of the unknowns. Without votes it is 0."""
    solution: FloatArray = np.zeros(len(prior))
    weight = trust
    for _ in range(_REWEIGHTED):
        weighted = matrix * weight[:, None]
        solution = np.asarray(
            np.linalg.solve(matrix.T @ weighted + prior, weighted.T @ wanted), np.float64
        )
        weight = trust / (1 + ((wanted - matrix @ solution) / _OUTLIER_PX) ** 2)
    return solution


def _prior(
    bases: Sequence[FloatArray], starts: IntArray, size: int, params: CorrectionParams
) -> FloatArray:
    """Inverse variances: all strokes are shifted by about 10 mm, one by 5 mm more and bends little,
    views move by 4 px. What all views have in common is then rather the strokes'."""
    prior = np.zeros((size, size))
    for basis, a in zip(bases, starts[:-1], strict=True):
        n = basis.shape[1]
        bending = np.diff(np.eye(n), 2, axis=0)
        local = 4e4 / n * np.eye(n) + params.stiffness * 1e6 * bending.T @ bending
        for axis in range(3):
            at = int(a) + axis + 3 * np.arange(n)
            prior[np.ix_(at, at)] = local
    shared = np.arange(int(starts[-1]), int(starts[-1]) + 3)
    prior[shared, shared] = 1e4
    views = np.arange(int(starts[-1]) + 3, size)
    prior[views, views] = np.tile([0.06, 0.06, 1.0, 1.0], len(views) // 4)
    return prior


def _basis(samples: int, per_control: int) -> FloatArray:
    """(samples, m) values of a clamped cubic B-spline basis."""
    inner = max(samples // per_control - 3, 1)
    knots = np.concatenate([np.zeros(4), np.arange(1, inner) / inner, np.ones(4)])
    return np.asarray(BSpline.design_matrix(np.linspace(0, 1, samples), knots, 3).todense())


def _jacobian(camera: Camera, points_m: FloatArray) -> FloatArray:
    """(n, 2, 3) change of the pixels with the points, without the lens's bending."""
    columns = [
        camera.project(points_m + _STEP_M * axis) - camera.project(points_m - _STEP_M * axis)
        for axis in np.eye(3)
    ]
    return np.stack(columns, axis=2) / (2 * _STEP_M)


def _motions(xy: FloatArray, camera: Camera) -> FloatArray:
    """(n, 2, 4) change of pixels with a view's shift, turn and growth; the last two in pixels at
    the border."""
    reach = max(camera.intrinsics.width, camera.intrinsics.height) / 2
    x, y = ((xy - _middle(camera)) / reach).T
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.stack([np.stack([one, zero, -y, x], 1), np.stack([zero, one, x, y], 1)], axis=1)


def _shifted(xy: FloatArray, shift: FloatArray, camera: Camera) -> FloatArray:
    return xy + _motions(xy, camera) @ shift


def _middle(camera: Camera) -> FloatArray:
    return np.array([camera.intrinsics.cx, camera.intrinsics.cy])


def _settled(vote: _Votes, drawn: ProjectedStroke, params: CorrectionParams) -> CorrectedStroke:
    """Points moved by their offset; where the trust is low, by what the neighbors along the DLO
    say. The offset that is reported is from where the stroke was ``drawn``."""
    offset = vote.offset.copy()
    known = np.isfinite(vote.normal[:, 0])
    if params.agree:
        for run in stretches(known, least=1):
            weight = vote.trust[run] ** 2 + 1e-3
            total = gaussian_filter1d(weight, params.smooth, mode="nearest")
            offset[run] = (
                gaussian_filter1d(weight * offset[run], params.smooth, mode="nearest") / total
            )
    xy = vote.xy + offset[:, None] * vote.normal
    whole = np.einsum("ni,ni->n", xy - drawn.xy, vote.normal)
    whole = np.where(known & ~np.isfinite(whole), offset, whole)
    return CorrectedStroke(xy, np.where(known, whole, np.nan), vote.trust, vote.width, vote.depth)
