"""``reconstruct``: pictures from known poses to the 3D curves of the DLOs."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from dlo_client.contracts import (
    Curve3D,
    CurveEnd,
    ModelUsed,
    NextView,
    OtherCurve,
    ReconstructRequest,
    ReconstructResult,
    ViewOutcome,
)
from numpy.typing import NDArray

from models.instances.scene import Scene
from models.reconstruction import dlo3ds
from models.reconstruction.association import Support
from models.reconstruction.centering import center
from models.reconstruction.curves import Curve
from models.reconstruction.drawing import reprojection
from models.reconstruction.reconstruct import (
    NotReconstructable,
    Reconstruction,
    ReconstructParams,
    reconstruct_all,
    reconstruct_strand,
)
from models.reconstruction.tracking import along, continuing_strand, overlap
from models.reconstruction.view_planning import NoView, Plan, PlanParams, plan_views
from models.reconstruction.views import Strand, View
from workers.stages import curves3d
from workers.stages.instances import perceive
from workers.stages.outcome import InvalidInput, Outcome, Stopwatch, Tools
from workers.stages.pictures import png, read_rgb

_CODE = "invalid_views"
_NEAR_TARGET_PX = 40.0
_SHORTEST_PX = 20
_BORDER_PX = 12.0
_SUSPICIOUS_PX = 2.0
"""A mean reprojection error above this is no noise of a centerline: the poses or the intrinsics are off."""


@dataclass(frozen=True)
class _Seen:
    """The pictures, what was found in each, and for every strand the id of its instance."""

    images: list[NDArray[np.uint8]]
    views: list[View]
    ids: list[list[int]]
    models: list[ModelUsed]

    def instance(self, view: int, strands: tuple[int, ...]) -> int | None:
        """Id of the longest of the strands."""
        lengths = [self.views[view].strands[s].length_px for s in strands]
        return self.ids[view][strands[int(np.argmax(lengths))]] if strands else None


def run(request: ReconstructRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    previous = curves3d.decode(request.previous, "previous") if request.previous is not None else None
    with watch.step("perceive"):
        seen = _perceive(request, tools)
    with watch.step("reconstruct"):
        found = _reconstruct(request, seen, previous)
        first = found[0]
        if previous is not None:
            first = replace(first, curve=along(first.curve, previous))
    with watch.step("plan"):
        plan = _plan(first, seen.views)
    with watch.step("encode"):
        files = _files(request, seen, [first, *found[1:]])
        result = _result(request, seen, [first, *found[1:]], previous, plan)
    return Outcome(result, files, watch.timings_ms)


def _perceive(request: ReconstructRequest, tools: Tools) -> _Seen:
    seen = _Seen([], [], [], [])
    for index, given in enumerate(request.views):
        field = f"views.{index}"
        if given.image is None:
            raise InvalidInput(f"{field}.image", "is missing")
        camera = curves3d.camera(given, field)
        image = read_rgb(given.image, f"{field}.image", tools)
        size = (camera.intrinsics.width, camera.intrinsics.height)
        if image.shape[1::-1] != size:
            found = f"{image.shape[1]} × {image.shape[0]}"
            message = f"are of a picture of {size[0]} × {size[1]} pixels, but this one has {found}"
            raise InvalidInput(f"{field}.intrinsics", message, "invalid_camera")
        scene = perceive(image, tools, model=request.model, threshold=request.threshold)
        strands, ids = _strands(scene.scene, scene.probability)
        straight = tuple(Strand.through(camera.undistort(xy), width) for xy, width in strands)
        seen.images.append(image)
        seen.views.append(View(camera, straight, given.name or f"views[{index}]"))
        seen.ids.append(ids)
        seen.models.extend(m for m in scene.models if m not in seen.models)
        tools.progress(0.9 * (index + 1) / len(request.views))
    return seen


def _strands(
    scene: Scene, probability: NDArray[np.float32]
) -> tuple[list[tuple[NDArray[np.float64], NDArray[np.float64]]], list[int]]:
    """Centerlines and widths of the instances that are long enough to say anything, and their ids."""
    strands, ids = [], []
    for number, instance in enumerate(scene.instances, start=1):
        centered = center(instance.centerline_xy, instance.width_px, probability)
        if centered is not None and len(centered[0]) > _SHORTEST_PX:
            strands.append(centered)
            ids.append(number)
    return strands, ids


def _reconstruct(request: ReconstructRequest, seen: _Seen, previous: Curve | None) -> list[Reconstruction]:
    """The target alone; without one the continuation of ``previous``, or all DLOs, longest first."""
    full = [view.name for view in seen.views if view.strands]
    if len(full) < 2:
        where = f"only in {full[0]}" if full else "in none of them"
        raise InvalidInput("views", f"a DLO was found {where}; two views at least have to show it", _CODE)
    params = ReconstructParams(points=request.points)
    chosen = _chosen(request, seen, previous)
    try:
        if request.method == "dlo3ds":
            view, strand = chosen or _longest(seen.views)
            return [dlo3ds.reconstruct(seen.views, view, strand, dlo3ds.Dlo3dsParams(points=request.points))]
        if chosen is not None:
            return [reconstruct_strand(seen.views, *chosen, params, previous)]
    except NotReconstructable as error:
        raise InvalidInput("views", str(error), _CODE) from error
    found = reconstruct_all(seen.views, params)
    if not found:
        raise InvalidInput("views", "no DLO is seen in two views so that the poses fit: are the poses right?", _CODE)
    return found


def _chosen(request: ReconstructRequest, seen: _Seen, previous: Curve | None) -> tuple[int, int] | None:
    """(view, strand) that the request asks for."""
    if request.target is not None:
        view = request.target.view
        if request.target.instance is not None:
            return view, _by_id(request.target.instance, view, seen)
        return view, _nearest(np.array([request.target.xy]), view, seen)
    if previous is None:
        return None
    following = continuing_strand(previous, seen.views)
    if following is None:
        raise InvalidInput("previous", "is seen in none of the views: the next pictures have to overlap it", _CODE)
    return following


def _by_id(instance: int, view: int, seen: _Seen) -> int:
    if instance not in seen.ids[view]:
        known = ", ".join(map(str, seen.ids[view])) or "none"
        raise InvalidInput(
            "target.instance", f"there is no instance {instance} in views[{view}]; there are: {known}", _CODE
        )
    return seen.ids[view].index(instance)


def _nearest(xy: NDArray[np.float64], view: int, seen: _Seen) -> int:
    samples = seen.views[view].samples
    if not len(samples.xy):
        raise InvalidInput("target.view", f"no DLO was found in views[{view}]", _CODE)
    distance, nearest = samples.tree.query(seen.views[view].camera.undistort(xy)[0])
    if distance > _NEAR_TARGET_PX:
        raise InvalidInput("target.xy", f"the nearest DLO is {distance:.0f} pixels away", _CODE)
    return int(samples.strand[nearest])


def _longest(views: list[View]) -> tuple[int, int]:
    sizes = [(s.length_px, -v, -k) for v, view in enumerate(views) for k, s in enumerate(view.strands)]
    _, v, k = max(sizes)
    return -v, -k


def _plan(found: Reconstruction, views: list[View]) -> Plan | None:
    used = [views[k].camera for k in found.used]
    try:
        return plan_views(found.curve, used, PlanParams(views=max(len(used), 2)))
    except NoView:
        return None


def next_view(plan: Plan) -> NextView:
    return NextView(
        baseline_m=round(plan.baseline_m, 6),
        delta_z_m=round(plan.delta_z_m, 6),
        T_world_camera=[curves3d.pose(pose) for pose in plan.poses],
        sigma_m=float(f"{plan.sigma_m:.4g}"),
        expected_sigma_m=float(f"{plan.expected_sigma_m:.4g}"),
        gain=round(plan.gain, 4),
        visible=round(plan.visible, 4),
    )


def _result(
    request: ReconstructRequest, seen: _Seen, found: list[Reconstruction], previous: Curve | None, plan: Plan | None
) -> ReconstructResult:
    first = found[0]
    curve: Curve3D = curves3d.encode(first.curve)
    return ReconstructResult(
        method=request.method,
        curve=curve,
        others=[
            OtherCurve(
                curve=curves3d.encode(other.curve),
                reprojection_px=round(other.reprojection_px, 4),
                instances=[seen.instance(k, s.strands) for k, s in enumerate(other.supports)],
            )
            for other in found[1:]
        ],
        views=[_view(request, seen, k, support) for k, support in enumerate(first.supports)],
        reprojection_px=round(first.reprojection_px, 4),
        noise_px=round(first.noise_px, 4),
        overlap=round(overlap(first.curve, previous), 4) if previous is not None else None,
        ends=_ends(first, seen.views),
        next_view=next_view(plan) if plan is not None else None,
        warnings=_warnings(first, seen.views),
        models=seen.models,
    )


def _view(request: ReconstructRequest, seen: _Seen, index: int, support: Support) -> ViewOutcome:
    used = support.verdict == "used"
    return ViewOutcome(
        name=seen.views[index].name,
        status="used" if used else "dropped",
        reason=None if used else _reason(support),
        instances_found=len(seen.views[index].strands),
        instance=seen.instance(index, support.strands),
        reprojection_px=round(support.reprojection_px, 4) if used else None,
        share=round(support.share, 4),
        intrinsics=request.views[index].intrinsics,
        T_world_camera=request.views[index].T_world_camera,
    )


def _reason(support: Support) -> str:
    match support.verdict:
        case "does_not_fit":
            return f"its nearest DLO lies {support.off_px:.0f} px from where the pose puts this one: is the pose right?"
        case "out_of_sight":
            return "the DLO lies outside this picture"
        case _:
            return "the DLO was not found in this picture"


def _ends(found: Reconstruction, views: list[View]) -> tuple[CurveEnd, CurveEnd]:
    """Whether the first and the last point lie at the border of a picture: then the DLO may go on."""
    used = [views[k].camera for k in found.used]
    ends = found.curve.points_m[[0, -1]]
    inside = np.all([camera.sees(camera.project(ends), _BORDER_PX) for camera in used], axis=0)
    return _end(inside[0]), _end(inside[1])


def _end(inside: bool) -> CurveEnd:
    return "free" if inside else "border"


def _warnings(found: Reconstruction, views: list[View]) -> list[str]:
    warnings = []
    misfits = [views[k].name for k, s in enumerate(found.supports) if s.verdict == "does_not_fit"]
    if misfits and len(found.used) == 2:
        warnings.append(
            f"the views contradict one another ({', '.join(misfits)} against the rest), and two that agree do not "
            "show which of them is wrong: check the poses"
        )
    elif misfits:
        warnings.append(f"the pose of {', '.join(misfits)} does not fit the other {len(found.used)} views")
    if found.reprojection_px > _SUSPICIOUS_PX:
        warnings.append(
            f"the curve misses the centerlines by {found.reprojection_px:.1f} px on average: "
            "poses or intrinsics are off"
        )
    if len(found.used) == 2 and not misfits:
        warnings.append("two views only: a wrong pose would go unnoticed")
    return warnings


def _files(request: ReconstructRequest, seen: _Seen, found: list[Reconstruction]) -> dict[str, tuple[str, bytes]]:
    files = {}
    curves = [f.curve for f in found]
    if "curve" in request.files:
        files["curve.ply"] = curves3d.ply_file(curves)
        files["curve.csv"] = curves3d.csv_file(curves)
    if "overlay" in request.files:
        for k, (image, view) in enumerate(zip(seen.images, seen.views, strict=True)):
            support = found[0].supports[k]
            dropped = None if support.verdict == "used" else f"dropped: {support.verdict.replace('_', ' ')}"
            files[f"overlay_{k}.png"] = ("image/png", png(reprojection(image, view.camera, curves, dropped)))
    return files
