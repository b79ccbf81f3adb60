"""``label_tracked``: pictures from known poses and a tracked pen's strokes to labels of every
picture (DLO-WSL)."""

from __future__ import annotations

import cv2
import numpy as np
from dlo_client.contracts import (
    Crossing,
    Endpoint,
    LabelTrackedRequest,
    LabelTrackedResult,
    MaskRLE,
    ModelUsed,
    StrandPosition,
    TrackedInstance,
    TrackedLabels,
)
from numpy.typing import NDArray

from models.geometry import painting, rle
from models.geometry.cameras import Camera
from models.instances.drawing import palette
from models.strands.stopwatch import Stopwatch
from models.tracked_labels.correction import CorrectedStroke, CorrectionParams
from models.tracked_labels.crops import reader_of
from models.tracked_labels.ends import EndParams
from models.tracked_labels.outlines import Strand, StrandCrossing, outline
from models.tracked_labels.strokes import StrokeError, in_robot_frame, stretches
from models.tracked_labels.tracked import TrackedParams, TrackedView, label_tracked
from models.weights.inference import default_name
from workers.stages.encoding import File, indexed_png, model_used, png
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.posed_pictures import read_view

_DOUBTFUL = 0.3
_BORDER_PX = 1.5
_KNOWN_GAP_M = 0.004
"""Depths of two strokes that differ by more than this say surely which DLO is on top."""


def run(request: LabelTrackedRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    with watch.step("decode"):
        images, cameras, remarks = _views(request, tools)
        strokes = _strokes(request, cameras)
    network = tools.network(default_name("corrector"))
    tools.progress(0.2)
    params = TrackedParams(
        spacing_px=request.spacing_px,
        measured=TrackedParams.measured if request.measure_width else 0.0,
        correct=request.correct,
        correction=CorrectionParams(
            agree=request.agree, aside_px=CorrectionParams.aside_px if request.agree else 0
        ),
        ends=EndParams() if request.find_ends else None,
    )
    thickness = [stroke.thickness_m for stroke in request.strokes]
    with watch.step("correct"):
        try:
            views = label_tracked(images, cameras, strokes, thickness, reader_of(network), params)
        except StrokeError as error:
            raise InvalidInput("strokes", str(error), "invalid_strokes") from error
    tools.progress(0.8)
    with watch.step("encode"):
        labels = [_labels(request, k, view) for k, view in enumerate(views)]
        files = _files(request, images, views)
    used: list[ModelUsed] = [model_used(network.spec)] if request.correct else []
    warnings = [*_warnings(request, labels), *remarks]
    return Outcome(
        LabelTrackedResult(views=labels, warnings=warnings, models=used), files, watch.timings_ms
    )


def _views(
    request: LabelTrackedRequest, tools: Tools
) -> tuple[list[NDArray[np.uint8]], list[Camera], list[str]]:
    views = [read_view(given, f"views.{index}", tools) for index, given in enumerate(request.views)]
    pictures, cameras = [picture for picture, _ in views], [camera for _, camera in views]
    return [p.rgb for p in pictures], cameras, [remark for p in pictures for remark in p.remarks]


def _strokes(request: LabelTrackedRequest, cameras: list[Camera]) -> list[NDArray[np.float64]]:
    """In the world's frame; every stroke is seen by some camera, or the frames are mixed up."""
    strokes = []
    for index, stroke in enumerate(request.strokes):
        points = np.array(stroke.points_m, np.float64)
        if request.T_world_tracker is not None:
            points = in_robot_frame(points, np.array(request.T_world_tracker))
        if not any(c.sees(np.nan_to_num(c.project(points), nan=-1e9)).any() for c in cameras):
            message = "lies outside every picture: is T_world_tracker right?"
            raise InvalidInput(f"strokes.{index}.points_m", message, "invalid_strokes")
        strokes.append(points)
    return strokes


def _labels(request: LabelTrackedRequest, index: int, view: TrackedView) -> TrackedLabels:
    given = request.views[index]
    masks = rle.encode_labels(view.ids, len(view.strands))
    height, width = view.ids.shape
    instances = [
        _instance(
            k, request, strand, view.corrections[k], MaskRLE(size=(height, width), counts=masks[k])
        )
        for k, strand in enumerate(view.strands)
        if strand is not None
    ]
    moved = np.concatenate([c.offset_px[np.isfinite(c.offset_px)] for c in view.corrections])
    return TrackedLabels(
        name=given.name or f"views.{index}",
        width=width,
        height=height,
        instances=instances,
        crossings=[_crossing(k, c) for k, c in enumerate(view.crossings, start=1)],
        moved_px=round(float(np.median(np.abs(moved))), 2) if len(moved) else 0.0,
        intrinsics=given.intrinsics,
        T_world_camera=given.T_world_camera,
    )


def _instance(
    number: int,
    request: LabelTrackedRequest,
    strand: Strand,
    correction: CorrectedStroke,
    mask: MaskRLE,
) -> TrackedInstance:
    run = max(stretches(np.isfinite(correction.offset_px)), key=lambda r: r.stop - r.start)
    trust = correction.trust[run].clip(0, 1)
    line = [(x, y) for x, y in np.round(strand.xy, 2).tolist()]
    height, width = mask.size
    ends = [
        Endpoint(xy=xy, kind="border" if _at_border(xy, width, height) else "free")
        for xy in (line[0], line[-1])
    ]
    return TrackedInstance(
        id=number + 1,
        name=request.strokes[number].name,
        score=round(float(trust.mean()), 4),
        centerline_xy=line,
        width_px=max(round(float(strand.width_px.mean()), 2), 0.01),
        endpoints=ends,
        mask_rle=mask,
        offset_px=[round(float(v), 2) for v in correction.offset_px[run]],
        trust=[round(float(v), 3) for v in trust],
    )


def _at_border(xy: tuple[float, float], width: int, height: int) -> bool:
    return min(xy[0], xy[1], width - 1 - xy[0], height - 1 - xy[1]) < max(
        _BORDER_PX, 0.02 * min(width, height)
    )


def _crossing(number: int, found: StrandCrossing) -> Crossing:
    sure = min(found.gap_m / _KNOWN_GAP_M, 1.0)
    return Crossing(
        id=number,
        xy=(round(found.xy[0], 2), round(found.xy[1], 2)),
        over=StrandPosition(instance=found.over[0] + 1, u=round(found.over[1], 4)),
        under=StrandPosition(instance=found.under[0] + 1, u=round(found.under[1], 4)),
        score=round(0.5 + 0.5 * sure, 4),
    )


def _warnings(request: LabelTrackedRequest, labels: list[TrackedLabels]) -> list[str]:
    warnings = []
    for index, stroke in enumerate(request.strokes, start=1):
        scores = [i.score for view in labels for i in view.instances if i.id == index]
        if request.correct and scores and np.mean(scores) < _DOUBTFUL:
            name = stroke.name or f"strokes.{index - 1}"
            warnings.append(
                f"{name}: its corrections are doubtful (mean trust {np.mean(scores):.2f}); look at them"
            )
    return warnings


def _files(
    request: LabelTrackedRequest, images: list[NDArray[np.uint8]], views: list[TrackedView]
) -> dict[str, File]:
    files = {}
    for k, (image, view) in enumerate(zip(images, views, strict=True)):
        if "labels" in request.files:
            files[f"labels_{k}.png"] = indexed_png(view.ids, palette())
        if "overlay" in request.files:
            files[f"overlay_{k}.png"] = png(_overlay(image, view))
    return files


def _overlay(image: NDArray[np.uint8], view: TrackedView) -> NDArray[np.uint8]:
    canvas, colors = image.copy(), palette()
    for k, strand in enumerate(view.strands, start=1):
        if strand is not None:
            red, green, blue = (int(c) for c in colors[k])
            for line, closed, thick in ((outline(strand), True, 1), (strand.xy, False, 1)):
                painting.stroke(canvas, line, (red, green, blue), thick, cv2.LINE_AA, closed)
    return canvas
