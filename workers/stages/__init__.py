"""One file per job kind: fetch arrays, call models, build the result."""

from __future__ import annotations

import os
from typing import assert_never

import cv2
import numpy as np
from dlo_client.contracts import (
    AnyRequest,
    DisentangleRequest,
    DloObject,
    EstimateParametersRequest,
    InstancesRequest,
    LabelTrackedRequest,
    MergeCurvesRequest,
    NetworkInfo,
    NextViewRequest,
    NoopRequest,
    PlanShapeRequest,
    ReconstructRequest,
    SegmentRequest,
    TopologyRequest,
)

from models.weights import inference
from models.weights.inference import NetworkSpec, Runtime
from workers.blobs import FolderBlobs
from workers.settings import Settings
from workers.stages import (
    estimate_parameters,
    instances,
    label_tracked,
    merge_curves,
    next_view,
    noop,
    plan_disentangle,
    plan_shape,
    reconstruct,
    segment,
    topology,
)
from workers.stages.foreground import Source
from workers.stages.outcome import Outcome, Tools
from workers.stages.perception import perceive


def run(request: AnyRequest, tools: Tools) -> Outcome:
    """Do one job; a kind without a case here is a type error."""
    match request:
        case NoopRequest():
            return noop.run(request)
        case SegmentRequest():
            return segment.run(request, tools)
        case InstancesRequest():
            return instances.run(request, tools)
        case PlanShapeRequest():
            return plan_shape.run(request, tools)
        case EstimateParametersRequest():
            return estimate_parameters.run(request, tools)
        case ReconstructRequest():
            return reconstruct.run(request, tools)
        case NextViewRequest():
            return next_view.run(request)
        case MergeCurvesRequest():
            return merge_curves.run(request)
        case TopologyRequest():
            return topology.run(request, tools)
        case DisentangleRequest():
            return plan_disentangle.run(request, tools)
        case LabelTrackedRequest():
            return label_tracked.run(request, tools)
        case _:
            assert_never(request)


def warm(settings: Settings) -> Tools:
    """Load every default network and use the slowest to start, so that the first job of a kind is not the slow one:
    one picture goes through the whole chain, and one plan is made."""
    threads = settings.onnx_threads or max(1, (os.cpu_count() or 1) // settings.workers)
    cv2.setNumThreads(threads)
    tools = Tools(
        blobs=FolderBlobs(settings.blobs_dir, settings.blob_ttl_s),
        max_image_pixels=settings.max_image_pixels,
        runtime=Runtime(settings.onnx_providers, threads, spinning=settings.workers == 1),
    )
    for spec in inference.manifest().values():
        if spec.default:
            tools.network(spec.name)
    perceive(Source(np.zeros((360, 640, 3), np.uint8), None, []), tools)
    plan_shape.run(_FIRST_PLAN, tools)
    tools.networks = [_info(spec, warm=spec.name in tools.loaded) for spec in inference.manifest().values()]
    return tools


_FIRST_PLAN = PlanShapeRequest(
    state_m=[(0.0, 0.0), (0.3, 0.0)], target_m=[(0.0, 0.0), (0.2, 0.15)], object=DloObject(mass_kg=0.05)
)


def _info(spec: NetworkSpec, *, warm: bool) -> NetworkInfo:
    return NetworkInfo(
        name=spec.name,
        version=spec.version,
        task=spec.task,
        default=spec.default,
        warm=warm,
        sha256=spec.sha256,
        bytes=spec.bytes,
        parameters=spec.parameters,
        input=spec.input,
        origin=spec.origin,
        license=spec.license,
        metrics=dict(spec.metrics),
    )
