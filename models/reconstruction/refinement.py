"""Bundle adjustment of the spline over all views, and the covariance that comes with it.

Strategy: the unknowns are the B-spline's control points. A residual is how far, in pixels and
across the strand, a sample of the curve projects from the nearest strand of its DLO; along the
strand nothing is measured, so no correspondence has to be right and a DLO along the baseline does
no harm. Third differences of the control points carry a smoothness prior whose weight is found
together with the noise by evidence maximization: effective numbers of parameters against what is
left over. Residuals of neighboring samples are alike (a centerline strays for a while), so the
information of the data is divided by (1 + r) / (1 - r) of their correlation r before anything is
stated about uncertainty. Each iteration is one dense Gauss-Newton step of 3 m unknowns (m about 10
to 45).

What is stated is not what the steps are made with: there, "across the strand" is across the strand
as it was found, whose direction is noisy. Where a DLO runs along the epipolar lines only that noise
seems to say something about the depth. So the covariance is that of residuals across the *curve* as
it projects, which is smooth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.geometry.cameras import NEAREST_M, Camera
from models.geometry.directions import quarter_turned, unit
from models.reconstruction.curves import Spline3D, basis, third_differences
from models.reconstruction.views import Samples, View

_UNSURE = 0.2
"""Standard deviation, as a share of the distance, of a sample that no view shows."""
_ANYWHERE = 2.0
"""The same of a whole DLO."""


@dataclass(frozen=True)
class RefineParams:
    """``gate_px``: farther strands say nothing; it closes from the first to the second value.
    ``turn``: largest sine between curve and strand. ``slide``: how far samples may slide along the
    curve in a step, in sample spacings. ``least_noise_px``: centerlines are never believed to be
    better than this. ``offset_px``: by so much all centerlines of a view may be shifted, in x and
    in y, against those of the others."""

    samples_per_span: int = 6
    iterations: int = 10
    gate_px: tuple[float, float] = (8.0, 3.0)
    turn: float = 0.7
    slide: float = 0.3
    least_noise_px: float = 0.1
    offset_px: float = 0.08


@dataclass(frozen=True, eq=False)
class Refined:
    """``residual_px`` (k, n) signed, across the strand; ``used`` (k, n); ``parameters`` (n,) of the
    samples; ``covariance`` (m, 3, m, 3) of the control points; ``noise_px`` of one residual;
    ``correlation`` of neighbors; ``alone_m2`` (n, 3, 3) covariance of a sample by itself, seen with
    a noise of one pixel across the curve."""

    spline: Spline3D
    parameters: FloatArray
    residual_px: FloatArray
    used: BoolArray
    covariance: FloatArray
    noise_px: float
    correlation: float
    alone_m2: FloatArray

    def covariance_at(self, parameters: FloatArray, stray: float) -> FloatArray:
        """(n, 3, 3) of the position across the curve. ``stray``: share of the noise that does not
        average out along the curve; it counts for most where strands run along the epipolar
        lines."""
        weights = basis(self.spline.knots, parameters)
        half = np.einsum("na,aibj->nibj", weights, self.covariance)
        full = np.einsum("nibj,nb->nij", half, weights)
        nearest = np.rint(parameters * (len(self.parameters) - 1)).astype(np.int64)
        full += (stray * self.noise_px) ** 2 * self.alone_m2[nearest]
        return across(full, self.spline.tangents(parameters))


def across(covariance: FloatArray, tangents: FloatArray) -> FloatArray:
    """(n, 3, 3) without the part along (n, 3) unit tangents."""
    keep = np.eye(3) - tangents[:, :, None] * tangents[:, None, :]
    projected: FloatArray = keep @ covariance @ keep
    return projected


@dataclass(frozen=True, eq=False)
class _Measured:
    """What a view shows of n samples: signed residual, (n, 3) its derivative by the point, whether
    it counts; and ``across`` (n, 3) the derivative of a residual along ``normal`` (n, 2), across
    the curve as it projects."""

    residual: FloatArray
    gradient: FloatArray
    used: BoolArray
    across: FloatArray
    normal: FloatArray


def refine(
    spline: Spline3D, views: list[View], strands: list[IntArray], params: RefineParams
) -> Refined:
    """``strands``: for each view the numbers of its strands that belong to this DLO, perhaps
    none."""
    seen = [Samples.of(view.strands, which) for view, which in zip(views, strands, strict=True)]
    cameras = [view.camera for view in views]
    spans = len(spline.control_m) - 3
    parameters = np.linspace(0, 1, spans * params.samples_per_span + 1)
    weights = basis(spline.knots, parameters)
    rough = third_differences(len(spline.control_m))
    # What a third difference is compared with at the start: the distance between control points.
    apart = float(np.linalg.norm(np.diff(spline.control_m, axis=0), axis=1).mean()) + 1e-9
    state = _State(spline, noise=1.0, correlation=0.0, smooth=1e-2 / apart**2)
    for step in range(params.iterations):
        share = min(step / max(params.iterations // 2, 1), 1.0)
        gate = params.gate_px[0] * (1 - share) + params.gate_px[1] * share
        measured = _measure_all(cameras, seen, state.spline, parameters, gate, params)
        state, moved = _step(state, parameters, weights, rough, measured, params)
        if share == 1.0 and moved < 0.02 * state.noise:
            break
    measured = _measure_all(cameras, seen, state.spline, parameters, gate, params)
    points = state.spline.at(parameters)
    distance = np.maximum(
        np.min([np.linalg.norm(points - c.center, axis=1) for c in cameras], axis=0), NEAREST_M
    )
    return Refined(
        state.spline,
        parameters,
        np.stack([m.residual for m in measured]),
        np.stack([m.used for m in measured]),
        _stated(state, parameters, weights, rough, measured, distance, params),
        state.noise,
        state.correlation,
        _alone(measured, distance),
    )


def _alone(measured: list[_Measured], distance: FloatArray) -> FloatArray:
    """(n, 3, 3) inverse information of the views' residuals, bounded by a share of the distance to
    the cameras."""
    gradients = np.stack([m.across * m.used[:, None] for m in measured])
    information = np.einsum("kni,knj->nij", gradients, gradients)
    inverse: FloatArray = np.linalg.inv(
        information + np.eye(3) / (_UNSURE * distance)[:, None, None] ** 2
    )
    return inverse


def _stated(
    state: _State,
    parameters: FloatArray,
    weights: FloatArray,
    rough: FloatArray,
    measured: list[_Measured],
    distance: FloatArray,
    params: RefineParams,
) -> FloatArray:
    """(m, 3, m, 3) covariance of the control points, of residuals across the curve and of shifts of
    whole views."""
    residual = np.concatenate([np.where(m.used, m.residual, 0.0) for m in measured])
    used = np.concatenate([m.used for m in measured])
    robust = used / (1 + (residual / (2.5 * state.noise)) ** 2)
    rows = np.concatenate(
        [(weights[:, :, None] * m.across[:, None]).reshape(len(weights), -1) for m in measured]
    )
    weighed = rows * (robust / (state.noise**2 * _spread(state)))[:, None]
    share = 1 / (len(weights) * (_ANYWHERE * distance) ** 2)
    anywhere = np.kron((weights * share[:, None]).T @ weights, np.eye(3))
    prior = state.smooth * np.kron(rough.T @ rough, np.eye(3))
    normal = (
        rows.T @ weighed + prior + anywhere + _held(state, parameters, weights, len(parameters))
    )
    covariance = np.linalg.inv(
        normal + 1e-12 * np.trace(normal) / len(normal) * np.eye(len(normal))
    )
    normals = np.stack([m.normal for m in measured])
    pulls = np.einsum("kna,kni->kia", weighed.reshape(*normals.shape[:2], -1), normals).reshape(
        -1, len(normal)
    )
    shifted = params.offset_px * pulls @ covariance
    count = weights.shape[1]
    return np.asarray(covariance + shifted.T @ shifted).reshape(count, 3, count, 3)


def _spread(state: _State) -> float:
    """What the information of residuals is divided by as neighbors are alike."""
    return (1 + state.correlation) / (1 - state.correlation)


def _held(state: _State, parameters: FloatArray, weights: FloatArray, slide: float) -> FloatArray:
    """(3 m, 3 m) information that holds samples along the curve, where nothing is measured, to
    ``slide`` spacings.

    That is for the steps: as information about the DLO it would be wrong, for it ties where a curve
    is to how its samples are spread along it.
    """
    tangents = state.spline.tangents(parameters)
    steps = np.linalg.norm(np.diff(state.spline.at(parameters), axis=0), axis=1)
    spacing = max(float(steps.mean()) * slide, 1e-9)
    along = (weights[:, :, None] * tangents[:, None]).reshape(len(weights), -1)
    return np.asarray(along.T @ along / spacing**2)


@dataclass(frozen=True, eq=False)
class _State:
    spline: Spline3D
    noise: float
    correlation: float
    smooth: float


def _measure_all(
    cameras: list[Camera],
    seen: list[Samples],
    spline: Spline3D,
    parameters: FloatArray,
    gate: float,
    params: RefineParams,
) -> list[_Measured]:
    points, tangents = spline.at(parameters), spline.tangents(parameters)
    return [
        _measure(c, s, points, tangents, gate, params) for c, s in zip(cameras, seen, strict=True)
    ]


def _measure(
    camera: Camera,
    seen: Samples,
    points: FloatArray,
    tangents: FloatArray,
    gate: float,
    params: RefineParams,
) -> _Measured:
    local = camera.in_camera(points)
    front = local[:, 2] > 1e-6
    depth = np.where(front, local[:, 2], 1.0)
    focal = np.array([camera.intrinsics.fx, camera.intrinsics.fy])
    middle = np.array([camera.intrinsics.cx, camera.intrinsics.cy])
    plane = local[:, :2] / depth[:, None]
    xy = plane * focal + middle
    if not len(seen.xy):
        nothing = np.zeros((len(xy), 3))
        return _Measured(
            np.full(len(xy), np.nan), nothing, np.zeros(len(xy), bool), nothing, nothing[:, :2]
        )
    _, nearest = seen.tree.query(np.where(front[:, None], xy, -1e6))
    normal, off = seen.normals[nearest], xy - seen.xy[nearest]
    residual = np.einsum("ni,ni->n", normal, off)
    along = np.abs(normal[:, 0] * off[:, 1] - normal[:, 1] * off[:, 0])
    heading = tangents @ camera.rotation
    flow = unit((heading[:, :2] - plane * heading[:, 2:]) * focal)
    turn = np.abs(np.einsum("ni,ni->n", flow, normal))
    used = front & (np.abs(residual) < gate) & ((along < 1.5) | ~seen.at_end[nearest])
    used &= turn < params.turn

    def by_point(direction: FloatArray) -> FloatArray:
        """(n, 3) derivative of the place in the picture along (n, 2) unit directions."""
        # d xy / d local = focal / depth (I, -plane)
        scaled = direction * focal / depth[:, None]
        by_local = np.concatenate([scaled, -np.einsum("ni,ni->n", scaled, plane)[:, None]], axis=1)
        return np.asarray(by_local @ camera.rotation.T)

    aside = quarter_turned(flow)
    return _Measured(residual, by_point(normal), used, by_point(aside), aside)


def _step(
    state: _State,
    parameters: FloatArray,
    weights: FloatArray,
    rough: FloatArray,
    measured: list[_Measured],
    params: RefineParams,
) -> tuple[_State, float]:
    """One Gauss-Newton step; new noise, correlation and smoothness; the mean move in pixels."""
    control = state.spline.control_m
    unknowns = control.size
    residual = np.concatenate([np.where(m.used, m.residual, 0.0) for m in measured])
    used = np.concatenate([m.used for m in measured])
    robust = used / (1 + (residual / (2.5 * state.noise)) ** 2)
    rows = np.concatenate(
        [(weights[:, :, None] * m.gradient[:, None]).reshape(len(weights), -1) for m in measured]
    )
    spread = _spread(state)
    scale = 1 / (state.noise**2 * spread)
    data = rows.T @ (rows * (robust * scale)[:, None])
    prior = np.kron(rough.T @ rough, np.eye(3))
    held = _held(state, parameters, weights, params.slide)
    normal = data + state.smooth * prior + held + 1e-9 * scale * np.eye(unknowns)
    right = -rows.T @ (robust * scale * residual) - state.smooth * prior @ control.reshape(-1)
    covariance = np.linalg.inv(normal)
    move = covariance @ right
    moved = Spline3D(state.spline.knots, control + move.reshape(-1, 3))
    left = residual + rows @ move
    effective = float(np.einsum("ij,ji->", covariance, data))
    count = max(float(robust.sum()) - effective * min(spread, 2.0), 0.2 * float(robust.sum()), 1.0)
    noise = max(float(np.sqrt(np.sum(robust * left**2) / count)), params.least_noise_px)
    free = 3 * len(rough) - state.smooth * float(np.einsum("ij,ji->", covariance, prior))
    bend = moved.control_m.reshape(-1) @ prior @ moved.control_m.reshape(-1)
    smooth = max(free, 1.0) / max(float(bend), 1e-12)
    mean_move = float(np.abs(rows @ move)[used].mean()) if used.any() else 0.0
    correlation = _correlation(left.reshape(len(measured), -1), used.reshape(len(measured), -1))
    return _State(moved, noise, correlation, smooth), mean_move


def _correlation(residual: FloatArray, used: BoolArray) -> float:
    """Of neighboring samples, 0 to 0.9."""
    both = used[:, 1:] & used[:, :-1]
    if both.sum() < 8:
        return 0.0
    product = float(np.mean((residual[:, 1:] * residual[:, :-1])[both]))
    square = float(np.mean((residual[:, 1:] ** 2 + residual[:, :-1] ** 2)[both])) / 2
    return min(max(product / max(square, 1e-12), 0.0), 0.9)
