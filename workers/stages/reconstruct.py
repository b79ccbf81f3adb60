"""``reconstruct``: pictures from known poses to the 3D curves of the DLOs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dlo_client.contracts import (
    CurveEnd,
    ModelUsed,
    OtherCurve,
    ReconstructRequest,
    ReconstructResult,
    ViewOutcome,
)

from models.reconstruction.association import Support
from models.reconstruction.curves import Curve
from models.reconstruction.drawing import reprojection
from models.reconstruction.published import dlo3ds
from models.reconstruction.reconstruct import (
    NotReconstructable,
    Reconstruction,
    ReconstructParams,
    reconstruct_all,
    reconstruct_strand,
)
from models.reconstruction.tracking import along, overlap
from models.reconstruction.uncertainty import depth_warning
from models.reconstruction.view_planning import NoView, Plan, PlanParams, plan_views
from models.reconstruction.views import View
from models.strands.stopwatch import Stopwatch
from workers.stages import curves3d
from workers.stages.encoding import overlay_png
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.seen_views import NO_CURVE, SeenView, chosen_strand, see

_BORDER_PX = 12.0
_LONGEST_M, _THICKEST_M = 500.0, 0.5
_ODD_THICKNESS_M = (1e-4, 0.1)
"""DLOs are thicker and thinner than this."""
_SUSPICIOUS_PX = 2.0
"""A mean reprojection error above this is no noise of a centerline: the poses or the intrinsics are
off."""


def run(request: ReconstructRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    previous = (
        curves3d.decode(request.previous, "previous") if request.previous is not None else None
    )
    with watch.step("perceive"):
        seen, models, remarks = see(request, tools)
    with watch.step("reconstruct"):
        found = _reconstruct(request, seen, previous)
        for each in found:
            _check_scale(each.curve)
        first = found[0]
        if previous is not None:
            first = replace(first, curve=along(first.curve, previous))
    with watch.step("plan"):
        plan = _plan(first, seen)
    with watch.step("encode"):
        curves = [first, *found[1:]]
        files = _files(request, seen, curves)
        result = _result(request, seen, curves, previous, plan, models, remarks)
    return Outcome(result, files, watch.timings_ms)


def _check_scale(curve: Curve) -> None:
    """Raises InvalidInput for a DLO of a size that none has, with the unit that the poses may be
    in."""
    thick = 2 * curve.mean_radius_m if np.isfinite(curve.mean_radius_m) else None
    if curve.length_m > _LONGEST_M or (thick is not None and thick > _THICKEST_M):
        size = f"{curve.length_m:.3g} m long" + (
            f" and {thick:.2g} m thick" if thick is not None else ""
        )
        text = f"make the DLO {size}: are the translations of `T_world_camera` in millimeters? They are in meters"
        raise InvalidInput("views", text, "invalid_scale")


def _reconstruct(
    request: ReconstructRequest, seen: list[SeenView], previous: Curve | None
) -> list[Reconstruction]:
    """The target alone; without one the continuation of ``previous``, or all DLOs, longest
    first."""
    views = [s.view for s in seen]
    full = [view.name for view in views if view.strands]
    if len(full) < 2:
        where = f"only in {full[0]}" if full else "in none of them"
        raise InvalidInput(
            "views", f"a DLO was found {where}; two views at least have to show it", NO_CURVE
        )
    params = ReconstructParams(points=request.points)
    chosen = chosen_strand(request, seen, previous)
    try:
        if request.method == "dlo3ds":
            view, strand = chosen or _longest(views)
            return [
                dlo3ds.reconstruct(views, view, strand, dlo3ds.Dlo3dsParams(points=request.points))
            ]
        if chosen is not None:
            return [reconstruct_strand(views, *chosen, params, previous)]
    except NotReconstructable as error:
        raise InvalidInput("views", str(error), NO_CURVE) from error
    found = reconstruct_all(views, params)
    if not found:
        raise InvalidInput(
            "views",
            "no DLO is seen in two views so that the poses fit: are the poses right?",
            NO_CURVE,
        )
    return found


def _longest(views: list[View]) -> tuple[int, int]:
    sizes = [
        (s.length_px, -v, -k) for v, view in enumerate(views) for k, s in enumerate(view.strands)
    ]
    _, v, k = max(sizes)
    return -v, -k


def _plan(found: Reconstruction, seen: list[SeenView]) -> Plan | None:
    used = [seen[k].camera for k in found.used]
    try:
        return plan_views(found.curve, used, PlanParams(views=max(len(used), 2)))
    except NoView:
        return None


def _result(
    request: ReconstructRequest,
    seen: list[SeenView],
    found: list[Reconstruction],
    previous: Curve | None,
    plan: Plan | None,
    models: list[ModelUsed],
    remarks: list[str],
) -> ReconstructResult:
    first = found[0]
    return ReconstructResult(
        method=request.method,
        curve=curves3d.encode(first.curve),
        others=[
            OtherCurve(
                curve=curves3d.encode(other.curve),
                reprojection_px=_reprojection_px(other, seen),
                instances=[
                    s.instance(support.strands)
                    for s, support in zip(seen, other.supports, strict=True)
                ],
            )
            for other in found[1:]
        ],
        views=[_view(request, seen[k], k, support) for k, support in enumerate(first.supports)],
        reprojection_px=_reprojection_px(first, seen),
        noise_px=round(first.noise_px / seen[first.reference].scale, 4),
        overlap=round(overlap(first.curve, previous), 4) if previous is not None else None,
        ends=_ends(first, seen),
        next_view=curves3d.next_view(plan) if plan is not None else None,
        reference=[s.reference for s in seen if s.reference is not None],
        warnings=[*_warnings(first, seen), *remarks],
        models=models,
    )


def _reprojection_px(found: Reconstruction, seen: list[SeenView]) -> float:
    """Mean over the views that took part, in pixels of the pictures."""
    return round(
        float(np.mean([found.supports[k].reprojection_px / seen[k].scale for k in found.used])), 4
    )


def _view(request: ReconstructRequest, seen: SeenView, index: int, support: Support) -> ViewOutcome:
    used = support.verdict == "used"
    return ViewOutcome(
        name=seen.view.name,
        status="used" if used else "dropped",
        reason=None if used else _reason(support, seen.scale),
        instances_found=len(seen.ids),
        instance=seen.instance(support.strands),
        reprojection_px=round(support.reprojection_px / seen.scale, 4) if used else None,
        share=round(support.share, 4),
        intrinsics=request.views[index].intrinsics,
        T_world_camera=request.views[index].T_world_camera,
    )


def _reason(support: Support, scale: float) -> str:
    match support.verdict:
        case "does_not_fit":
            return f"the DLO lies {support.off_px / scale:.0f} px from where the pose puts it: is the pose right?"
        case "out_of_sight":
            return "the DLO lies outside this picture"
        case _:
            return "the DLO was not found in this picture"


def _ends(found: Reconstruction, seen: list[SeenView]) -> tuple[CurveEnd, CurveEnd]:
    """Whether the first and the last point lie at the border of a picture: then the DLO may go
    on."""
    used = [seen[k].view.camera for k in found.used]
    ends = found.curve.points_m[[0, -1]]
    inside = np.all([camera.sees(camera.project(ends), _BORDER_PX) for camera in used], axis=0)
    return _end(inside[0]), _end(inside[1])


def _end(inside: bool) -> CurveEnd:
    return "free" if inside else "border"


def _warnings(found: Reconstruction, seen: list[SeenView]) -> list[str]:
    unseen = depth_warning(found.curve, [seen[k].camera for k in found.used])
    warnings = [] if unseen is None else [unseen]
    misfits = [
        seen[k].view.name for k, s in enumerate(found.supports) if s.verdict == "does_not_fit"
    ]
    if misfits and len(found.used) == 2:
        warnings.append(
            f"the views contradict one another ({', '.join(misfits)} against the rest), and two that agree do not "
            "show which of them is wrong: check the poses"
        )
    elif misfits:
        warnings.append(
            f"the pose of {', '.join(misfits)} does not fit the other {len(found.used)} views"
        )
    thick = 2 * found.curve.mean_radius_m
    if thick < _ODD_THICKNESS_M[0] or thick > _ODD_THICKNESS_M[1]:
        warnings.append(
            f"the DLO would be {1000 * thick:.3g} mm thick: are the translations of the poses in meters?"
        )
    if found.reprojection_px > _SUSPICIOUS_PX:
        warnings.append(
            f"the curve misses the centerlines by {found.reprojection_px:.1f} px on average: "
            "poses or intrinsics are off"
        )
    if len(found.used) == 2 and not misfits:
        warnings.append("two views only: a wrong pose would go unnoticed")
    return warnings


def _files(
    request: ReconstructRequest, seen: list[SeenView], found: list[Reconstruction]
) -> dict[str, tuple[str, bytes]]:
    files = {}
    curves = [f.curve for f in found]
    if "curve" in request.files:
        files["curve.ply"] = curves3d.ply_file(curves)
        files["curve.csv"] = curves3d.csv_file(curves)
    if "overlay" in request.files:
        for k, s in enumerate(seen):
            support = found[0].supports[k]
            dropped = (
                None
                if support.verdict == "used"
                else f"dropped: {support.verdict.replace('_', ' ')}"
            )
            files[f"overlay_{k}.png"] = overlay_png(
                reprojection(s.image, s.camera, curves, dropped)
            )
    return files
