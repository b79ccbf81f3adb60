"""``instances``: picture, or foreground mask, to DLO instances."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal

import numpy as np
from dlo_client.contracts import (
    Crossing,
    Endpoint,
    Instance,
    InstancesRequest,
    InstancesResult,
    MaskRLE,
    ModelUsed,
    Point,
    SceneStatus,
    Spline,
    StrandPosition,
)
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod, MethodParams
from numpy.typing import NDArray

from models.geometry import rle
from models.geometry.polylines import resample
from models.instances import scene as found
from models.instances.drawing import palette
from models.instances.overlay import overlay
from models.segmentation.segment import foreground_mask
from models.strands.stopwatch import Stopwatch
from workers.stages.instance_methods import extract_with
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.pictures import indexed_png, png, read_mask, read_rgb
from workers.stages.segment import foreground, mask_png, model_used

MASK_THRESHOLD = 0.5
_ABOVE_ZERO = 1e-6
_DECIMALS = 2
_SURE = 0.8
"""What is less likely right makes the whole answer unsure."""


@dataclass(frozen=True)
class Perception:
    """What was seen in one picture."""

    scene: found.Scene
    probability: NDArray[np.float32]
    threshold: float
    models: list[ModelUsed]
    timings_ms: dict[str, float]


def run(request: InstancesRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    with watch.step("decode"):
        image = read_rgb(request.image, "image", tools) if request.image is not None else None
        mask = read_mask(request.mask, "mask", tools) if request.mask is not None else None
        _check(image, mask)
    tools.progress(0.1)
    seen = perceive(
        image, tools, mask=mask, model=request.model, threshold=request.threshold,
        method=request.method, params=request.params,
    )  # fmt: skip
    tools.progress(0.8)
    with watch.step("encode"):
        masks = rle.encode_labels(seen.scene.labels, len(seen.scene.instances))
        instances = [
            _instance(k, item, MaskRLE(size=seen.probability.shape, counts=counts), request.points_per_instance)
            for k, (item, counts) in enumerate(zip(seen.scene.instances, masks, strict=True), start=1)
        ]
        files = _files(request, image, seen)
    height, width = seen.probability.shape
    result = InstancesResult(
        width=width,
        height=height,
        method=request.method,
        threshold=seen.threshold,
        instances=instances,
        crossings=[_crossing(k, item) for k, item in enumerate(seen.scene.crossings, start=1)],
        status=_status(seen.scene),
        models=seen.models,
    )
    return Outcome(result, files, watch.timings_ms | seen.timings_ms)


def perceive(
    image: NDArray[np.uint8] | None,
    tools: Tools,
    *,
    mask: NDArray[np.float32] | None = None,
    model: str | None = None,
    threshold: float | None = None,
    method: InstanceMethod = DEFAULT_METHOD,
    params: MethodParams | None = None,
) -> Perception:
    """The whole chain on arrays: ``image`` (H, W, 3) and/or ``mask`` (H, W) probability."""
    watch, models = Stopwatch(), []
    with watch.step("segment"):
        if mask is not None:
            probability, applied = mask, MASK_THRESHOLD if threshold is None else threshold
            cable = probability >= max(applied, _ABOVE_ZERO)
        elif image is not None:
            spec, settings, probability = foreground(image, model, tools)
            applied = settings.threshold if threshold is None else threshold
            cable = foreground_mask(probability, settings, threshold)
            models.append(model_used(spec))
        else:
            raise InvalidInput("image", "an image or a mask is needed")
    extract, networks = extract_with(method, params, tools)
    models += [model_used(network.spec) for network in networks]
    with watch.step("instances"):
        scene = extract(cable, image)
    timings = watch.timings_ms | {f"instances.{name}": ms for name, ms in scene.timings_ms.items()}
    return Perception(scene, probability, applied, models, timings)


def _check(image: NDArray[np.uint8] | None, mask: NDArray[np.float32] | None) -> None:
    if image is not None and mask is not None and image.shape[:2] != mask.shape:
        (h, w), (mh, mw) = image.shape[:2], mask.shape
        raise InvalidInput("mask", f"is {mw} × {mh} while the image is {w} × {h}", "invalid_mask")


def _files(
    request: InstancesRequest, image: NDArray[np.uint8] | None, seen: Perception
) -> dict[str, tuple[str, bytes]]:
    files = {}
    if "instances" in request.files:
        files["instances.png"] = ("image/png", indexed_png(seen.scene.labels, palette()))
    if "overlay" in request.files:
        ground = image if image is not None else _gray(seen.probability)
        files["overlay.png"] = ("image/png", png(overlay(ground, seen.scene)))
    if "mask" in request.files:
        files["mask.png"] = ("image/png", mask_png(seen.probability))
    return files


def _gray(probability: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.repeat(np.rint(probability * 120).astype(np.uint8)[:, :, None], 3, axis=2)


def _status(scene: found.Scene) -> SceneStatus:
    unsure = [i for i in scene.instances if i.score < _SURE]
    doubtful = [c for c in scene.crossings if min(c.score, c.existence) < _SURE]
    reasons = Counter(reason for instance in unsure for reason in instance.reasons)
    code: Literal["ok", "unsure", "none_found"] = "unsure" if unsure or doubtful else "ok"
    return SceneStatus(
        code=code if scene.instances else "none_found", limit=_SURE, reasons=[r for r, _ in reasons.most_common()]
    )


def _instance(number: int, item: found.Instance, mask: MaskRLE, points: int | None) -> Instance:
    centerline = item.centerline_xy if points is None else resample(item.centerline_xy, points)
    return Instance(
        id=number,
        score=round(item.score, 4),
        reasons=list(item.reasons),
        centerline_xy=_points(centerline),
        width_px=round(item.width_px, _DECIMALS),
        length_px=round(item.length_px, _DECIMALS),
        closed=item.closed,
        spline=Spline(
            degree=item.spline.degree,
            knots=[round(float(k), 6) for k in item.spline.knots],
            control_xy=_points(item.spline.control_xy),
        ),
        endpoints=[Endpoint(xy=_point(e.xy), kind=e.kind) for e in item.endpoints],
        mask_rle=mask,
    )


def _crossing(number: int, item: found.Crossing) -> Crossing:
    return Crossing(
        id=number,
        xy=_point(item.xy),
        over=StrandPosition(instance=item.over.instance, u=round(item.over.u, 4)),
        under=StrandPosition(instance=item.under.instance, u=round(item.under.u, 4)),
        score=round(item.score, 4),
        existence=round(item.existence, 4),
    )


def _point(xy: tuple[float, float]) -> Point:
    return round(float(xy[0]), _DECIMALS), round(float(xy[1]), _DECIMALS)


def _points(xy: NDArray[np.float64]) -> list[Point]:
    return [(x, y) for x, y in np.round(xy, _DECIMALS).tolist()]
