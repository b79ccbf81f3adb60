"""``segment``: picture to foreground probability."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts import SegmentRequest, SegmentResult

from models.strands.stopwatch import Stopwatch
from workers.stages.encoding import mask_png
from workers.stages.foreground import Source, find_foreground, settled
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.pictures import read_picture


def run(request: SegmentRequest, tools: Tools) -> Outcome:
    if request.image is None:
        raise InvalidInput("image", "is missing")
    watch = Stopwatch()
    with watch.step("decode"):
        source = Source.of(
            read_picture(request.image, "image", tools, may_be_mask=request.model is None)
        )
    tools.progress(0.2)
    with watch.step("segment"):
        found = find_foreground(source, tools, request, request.threshold)
    with watch.step("settle"):
        found = settled(found, source, request, request.threshold)
    with watch.step("encode"):
        files = {"mask.png": mask_png(found.probability)}
    height, width = found.probability.shape
    result = SegmentResult(
        width=width,
        height=height,
        coverage=float(np.count_nonzero(found.probability >= found.threshold))
        / found.probability.size,
        threshold=found.threshold,
        reference=found.references,
        warnings=source.remarks,
        models=found.models,
    )
    return Outcome(result, files, watch.timings_ms)
