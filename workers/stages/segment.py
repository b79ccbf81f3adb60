"""``segment``: picture to foreground probability."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts import ModelUsed, SegmentRequest, SegmentResult
from numpy.typing import NDArray

from models.segmentation.segment import ForegroundInput, segment
from models.strands.stopwatch import Stopwatch
from models.weights.inference import NetworkSpec, default_name, manifest
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.pictures import png, read_rgb

TASK = "foreground"


def run(request: SegmentRequest, tools: Tools) -> Outcome:
    if request.image is None:
        raise InvalidInput("image", "is missing")
    watch = Stopwatch()
    with watch.step("decode"):
        image = read_rgb(request.image, "image", tools)
    tools.progress(0.2)
    with watch.step("segment"):
        spec, settings, probability = foreground(image, request.model, tools)
    threshold = settings.threshold if request.threshold is None else request.threshold
    with watch.step("encode"):
        files = {"mask.png": ("image/png", mask_png(probability))}
    result = SegmentResult(
        width=image.shape[1],
        height=image.shape[0],
        coverage=float(np.count_nonzero(probability >= threshold)) / probability.size,
        threshold=threshold,
        models=[model_used(spec)],
    )
    return Outcome(result, files, watch.timings_ms)


def foreground(
    image: NDArray[np.uint8], model: str | None, tools: Tools
) -> tuple[NetworkSpec, ForegroundInput, NDArray[np.float32]]:
    """The network named ``model``, or the default one, its settings, and what it sees: probability (H, W)."""
    name = model or default_name(TASK)
    spec = manifest().get(name)
    if spec is None or spec.task != TASK:
        known = ", ".join(s.name for s in manifest().values() if s.task == TASK)
        raise InvalidInput("model", f"there is no foreground network {name!r}; there are: {known}", "invalid_model")
    settings = ForegroundInput.from_manifest(spec.preprocess)
    return spec, settings, segment(image, tools.network(name), settings)


def mask_png(probability: NDArray[np.float32]) -> bytes:
    return png(np.rint(probability * 255).astype(np.uint8))


def model_used(spec: NetworkSpec) -> ModelUsed:
    return ModelUsed(name=spec.name, version=spec.version, sha256=spec.sha256[:12])
