"""How well the label of one frame labels the frames after it: the stage of the service, and the
SDK's propagation."""

from __future__ import annotations

import io
import tempfile
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
from dlo_client.contracts import ImageRef, InstancesRequest, TrackState
from dlo_client.labelling import LabelledInstance, PictureLabel
from dlo_client.labelling.formats.pixels import encode
from dlo_client.labelling.propagation import label_of_frame, track_of
from PIL import Image

from models.weights.inference import Runtime
from tests.benchmarks.tracking_clips import ClipKind, Seen, clip
from tests.benchmarks.tracking_scoring import LEAST_VISIBLE
from workers.blobs import FolderBlobs
from workers.stages import instances
from workers.stages.outcome import Tools

FRAMES = 100
_LAST = 10


def propagated(kind: ClipKind, seed: int, tuning: bool) -> dict[str, float]:
    """Mean IoU, percent, of the masks of all cables in view over the frames after the first, and
    over the last ten."""
    first, *rest = islice(clip(kind, seed, tuning), FRAMES + 1)
    state = track_of(_label(first, kind.params.width_px))
    known = frozenset(cable.id for cable in state.cables)
    with tempfile.TemporaryDirectory() as folder:
        blobs = FolderBlobs(Path(folder), 3600.0)
        tools = Tools(blobs, 1_000_000, Runtime(["CPUExecutionProvider"], 1, spinning=False))
        overlaps = []
        for frame in rest:
            label, state = _labelled(frame, state, known, tools)
            overlaps.append(_overlaps(label, frame))
    return {
        "iou": round(100 * float(np.mean(np.concatenate(overlaps))), 1),
        "last": round(100 * float(np.mean(np.concatenate(overlaps[-_LAST:]))), 1),
    }


def _labelled(
    frame: Seen, state: TrackState, known: frozenset[int], tools: Tools
) -> tuple[PictureLabel, TrackState]:
    mask = io.BytesIO()
    Image.fromarray(frame.mask.astype(np.uint8) * 255).save(mask, "PNG")
    image, foreground = (
        ImageRef(id=tools.blobs.put(data)) for data in (frame.jpeg, mask.getvalue())
    )
    request = InstancesRequest(image=image, mask=foreground, previous=state, files=[])
    result = instances.run(request, tools).result
    assert result.track is not None
    return label_of_frame(result, "frame", "", known), result.track


def _label(frame: Seen, width_px: float) -> PictureLabel:
    """The true one, as a person would draw it."""
    height, width = frame.mask.shape
    items = [
        LabelledInstance(
            id=k,
            centerline_xy=line[_stretch(seen)][::8].tolist(),
            width_px=width_px,
            mask_rle=encode(mask),
        )
        for k, (line, seen, mask) in enumerate(
            zip(frame.centerlines, frame.in_view, _true(frame), strict=True), start=1
        )
    ]
    return PictureLabel(
        name="first", width=width, height=height, instances=items, origin="corrected"
    )


def _stretch(seen: np.ndarray) -> slice:
    """From the first to the last point in view: a person draws on through a crossing."""
    there = np.flatnonzero(seen)
    return slice(int(there[0]), int(there[-1]) + 1)


def _true(frame: Seen) -> list[np.ndarray]:
    """(H, W) of each cable: the foreground that is nearest to where it is in view."""
    away = []
    for line, seen in zip(frame.centerlines, frame.in_view, strict=True):
        drawn = np.ones(frame.mask.shape, np.uint8)
        column, row = np.rint(line[seen]).astype(int).T
        drawn[row, column] = 0
        away.append(
            cv2.distanceTransform(drawn, cv2.DIST_L2, 5)
            if seen.any()
            else np.full(drawn.shape, 1e6)
        )
    owner = np.argmin(away, axis=0)
    return [frame.mask & (owner == k) for k in range(len(away))]


def _overlaps(label: PictureLabel, frame: Seen) -> list[float]:
    found = {item.id: item.mask_rle.array() for item in label.instances}
    nothing = np.zeros_like(frame.mask)
    out = []
    for k, (true, seen) in enumerate(zip(_true(frame), frame.in_view, strict=True), start=1):
        if seen.mean() > LEAST_VISIBLE:
            mask = found.get(k, nothing)
            out.append(float((mask & true).sum() / (mask | true).sum()))
    return out
