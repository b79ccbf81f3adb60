"""``instances``: picture, or foreground mask, to DLO instances."""

from __future__ import annotations

from collections import Counter
from typing import Literal

from dlo_client.contracts import (
    Crossing,
    Endpoint,
    ImageRef,
    Instance,
    InstancesRequest,
    InstancesResult,
    MaskRLE,
    Reason,
    SceneStatus,
    Spline,
    StrandPosition,
)
from dlo_client.labelling.labels import label_of

from models.depth.order import covered_stretches
from models.geometry import rle
from models.geometry.polylines import resample
from models.instances import scene as found
from models.instances.confidence import SURE
from models.instances.drawing import palette
from models.instances.overlay import overlay
from models.strands.stopwatch import Stopwatch
from workers.stages.depth import SeenDepth, curve_fields, plane, read_depth
from workers.stages.encoding import (
    OVERLAY_SIDE,
    File,
    as_point,
    as_points,
    indexed_png,
    mask_png,
    overlay_png,
)
from workers.stages.foreground import read_source
from workers.stages.outcome import Outcome, Tools
from workers.stages.perception import Perception, perceive
from workers.stages.tracking import track_frame

_DECIMALS = 2


def run(request: InstancesRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    with watch.step("decode"):
        depth = read_depth(request, tools)
        source = read_source(request, tools, depth)
    tools.progress(0.1)
    seen = perceive(
        source,
        tools,
        request,
        threshold=request.threshold,
        method=request.method,
        params=request.params,
        depth=depth,
    )
    tools.progress(0.8)
    tracked = None
    if request.previous is not None:
        with watch.step("track"):
            tracked = track_frame(request.previous, seen, request.time_s, depth)
    with watch.step("encode"):
        size = seen.foreground.probability.shape
        masks = rle.encode_labels(seen.scene.labels, len(seen.scene.instances))
        instances = [
            _instance(
                k, seen.scene, MaskRLE(size=size, counts=counts), request.points_per_instance, depth
            )
            for k, counts in enumerate(masks, start=1)
        ]
        files = _files(request, seen)
    height, width = size
    result = InstancesResult(
        width=width,
        height=height,
        method=request.method,
        threshold=seen.foreground.threshold,
        instances=instances,
        crossings=[_crossing(k, item) for k, item in enumerate(seen.scene.crossings, start=1)],
        cables=tracked and tracked.cables,
        cable_crossings=tracked and tracked.crossings,
        track=tracked and tracked.track,
        table=plane(depth),
        status=_status(seen.scene),
        reference=seen.foreground.references,
        warnings=[*source.remarks, *_remarks(seen)],
        models=seen.models,
    )
    _offer(request, result, tools)
    return Outcome(result, files, watch.timings_ms | seen.timings_ms)


def _offer(request: InstancesRequest, result: InstancesResult, tools: Tools) -> None:
    """Keep the picture for its owner if that is allowed and the answer is among the least sure
    ones."""
    if (
        not request.keep_if_unsure
        or tools.unsure is None
        or not isinstance(request.image, ImageRef)
    ):
        return
    label = label_of(result, "")
    tools.unsure.offer(tools.owner, tools.blobs.get(request.image.id), label.certainty, label.doubt)


def _files(request: InstancesRequest, seen: Perception) -> dict[str, File]:
    files = {}
    if "instances" in request.files:
        files["instances.png"] = indexed_png(seen.scene.labels, palette())
    if "overlay" in request.files:
        files["overlay.png"] = overlay_png(
            overlay(seen.foreground.picture, seen.scene, OVERLAY_SIDE)
        )
    if "mask" in request.files:
        files["mask.png"] = mask_png(seen.foreground.probability)
    return files


def _status(scene: found.Scene) -> SceneStatus:
    unsure = [i for i in scene.instances if i.score < SURE]
    doubtful = [c for c in scene.crossings if min(c.score, c.existence) < SURE]
    reasons: Counter[Reason] = Counter(reason for instance in unsure for reason in instance.reasons)
    reasons["crossing"] = sum(c.existence < SURE for c in scene.crossings)
    reasons["order"] = sum(c.score < SURE for c in scene.crossings)
    code: Literal["ok", "unsure", "none_found"] = "unsure" if unsure or doubtful else "ok"
    return SceneStatus(
        code=code if scene.instances else "none_found",
        limit=SURE,
        reasons=[r for r, n in reasons.most_common() if n],
    )


def _remarks(seen: Perception) -> list[str]:
    """Why nothing was found where there is foreground."""
    share = float(seen.foreground.cable.mean())
    if seen.scene.instances or not share:
        return []
    return [
        f"{100 * share:.3g} % of the picture is foreground, but no part of it has the shape of a cable"
    ]


def _instance(
    number: int, scene: found.Scene, mask: MaskRLE, points: int | None, depth: SeenDepth | None
) -> Instance:
    item = scene.instances[number - 1]
    centerline = item.centerline_xy if points is None else resample(item.centerline_xy, points)
    covered = covered_stretches(scene, number)
    return Instance(
        id=number,
        score=round(item.score, 4),
        reasons=list(item.reasons),
        centerline_xy=as_points(centerline),
        width_px=round(item.width_px, _DECIMALS),
        length_px=round(item.length_px, _DECIMALS),
        closed=item.closed,
        spline=Spline(
            degree=item.spline.degree,
            knots=[round(float(k), 6) for k in item.spline.knots],
            control_xy=as_points(item.spline.control_xy),
        ),
        endpoints=[Endpoint(xy=as_point(e.xy), kind=e.kind) for e in item.endpoints],
        mask_rle=mask,
        **curve_fields(depth, item.centerline_xy, item.width_px, covered, len(centerline)),
    )


def _crossing(number: int, item: found.Crossing) -> Crossing:
    return Crossing(
        id=number,
        xy=as_point(item.xy),
        over=StrandPosition(instance=item.over.instance, u=round(item.over.u, 4)),
        under=StrandPosition(instance=item.under.instance, u=round(item.under.u, 4)),
        score=round(item.score, 4),
        existence=round(item.existence, 4),
    )
