"""One file per job kind: fetch arrays, call models, build the result."""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from typing import assert_never

import cv2
import numpy as np
import structlog
from dlo_client.contracts import (
    AdaptRequest,
    AnyRequest,
    DisentangleRequest,
    EstimateParametersRequest,
    ImportNetworkRequest,
    InstancesRequest,
    JobKind,
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
from pydantic import ValidationError

from models.weights import inference
from models.weights.inference import NetworkSpec, Runtime
from workers.blobs import open_blobs
from workers.networks.store import NetworkStore
from workers.settings import Settings
from workers.stages import (
    adapt,
    estimate_parameters,
    first_use,
    import_network,
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
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.unsure import UnsureStore

log = structlog.get_logger(__name__)


_ABOUT: dict[JobKind, str] = {
    "noop": "hold_s",
    "segment": "image",
    "instances": "image",
    "topology": "image",
    "plan_disentangle": "topology",
    "reconstruct": "views",
    "next_view": "cameras",
    "merge_curves": "curves",
    "label_tracked": "strokes",
    "plan_shape": "target_m",
    "estimate_parameters": "history",
    "import_network": "file",
    "adapt": "labels",
}
"""The field that the numbers of each kind come from."""


def run(request: AnyRequest, tools: Tools) -> Outcome:
    """Do one job.

    Numbers that arithmetic fails on, or that lead to an answer which its contract does not allow
    (NaN, infinite, out of range), are the request's: nothing of that kind leaves as an answer. They
    are also logged, as a check is missing.
    """
    try:
        return _run(request, tools)
    except (ArithmeticError, np.linalg.LinAlgError, ValidationError) as error:
        log.exception("numbers of the request lead nowhere", kind=request.kind)
        text = f"holds numbers that cannot be computed with ({type(error).__name__}): are scales and units right?"
        raise InvalidInput(_ABOUT[request.kind], text, "invalid_numbers") from error


def _run(request: AnyRequest, tools: Tools) -> Outcome:
    """A kind without a case here is a type error."""
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
        case AdaptRequest():
            return adapt.run(request, tools)
        case ImportNetworkRequest():
            return import_network.run(request, tools)
        case _:
            assert_never(request)


def warm(settings: Settings) -> Tools:
    """Load every default network and use what is slow at first, so that the first job of a kind is
    not the slow one."""
    threads = settings.onnx_threads or max(1, (os.cpu_count() or 1) // settings.workers)
    cv2.setNumThreads(threads)
    tools = Tools(
        blobs=open_blobs(settings, settings.disk_reserve_bytes // 2),
        max_image_pixels=settings.max_image_pixels,
        runtime=Runtime(settings.onnx_providers, threads, spinning=settings.workers == 1),
        store=NetworkStore.of(settings),
        default_model=settings.default_model,
        max_network_bytes=settings.max_network_bytes,
        training_dir=settings.training_dir,
        unsure=UnsureStore.of(settings),
    )
    for spec in inference.manifest().values():
        if spec.default:
            tools.network(spec.name)
    _say_where(
        settings.onnx_providers, {network.provider for network in tools.weights.loaded.values()}
    )
    first_use.use(tools)
    tools.networks = [
        _info(spec, warm=spec.name in tools.weights.loaded)
        for spec in inference.manifest().values()
    ]
    return tools


def _say_where(wanted: Sequence[str], used: Collection[str]) -> None:
    """A worker that falls back to the processor computes the same, but slower: somebody should hear
    of it."""
    if set(wanted[:1]) == set(used):
        log.info("networks loaded", providers=sorted(used))
    else:
        log.warning(
            "networks do not run where they are to run first",
            wanted=list(wanted),
            providers=sorted(used),
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
