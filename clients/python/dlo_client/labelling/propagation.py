"""From a label to a track, and from a tracked picture to its label. Needs ``dlo-client[label]``.

Strategy: the cables of a corrected label are handed to the service as the state of a track, so the
next picture is about exactly these cables, under their ids. A cable's mask there is the foreground
that is nearest to its centerline where it is in view; what is left of an instance that only one
cable is on stays its, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from dlo_client.contracts import InstancesResult, TrackedCable, TrackNodes, TrackState
from dlo_client.contracts.tracking import MOST_CABLES, NODES
from dlo_client.labelling.formats.pixels import encode
from dlo_client.labelling.labels import LabelledInstance, PictureLabel
from dlo_client.polylines import arc_lengths

Points = NDArray[np.float64]
_REACH_WIDTHS = 0.75
"""Foreground so near to a centerline is its cable's."""
_BORDER_WIDTHS = 1.5
_UNKNOWN_CABLE = 0.5
"""Certainty of a cable that the corrected picture did not show, at most."""
_FINE = 16
"""OpenCV draws on a grid of 1/16 px."""


def track_of(label: PictureLabel) -> TrackState:
    """The state of a track whose last picture showed the cables of ``label``, with their ids.

    Raises ValueError naming the instance: one without a centerline.
    """
    cables = [_nodes(instance, label) for instance in label.instances[:MOST_CABLES]]
    return TrackState(
        frame=1, next_id=max((cable.id for cable in cables), default=0) + 1, cables=cables
    )


def _nodes(instance: LabelledInstance, label: PictureLabel) -> TrackNodes:
    line = np.array(instance.centerline_xy, float).reshape(-1, 2)
    lengths = arc_lengths(line)
    if len(line) < 2 or lengths[-1] <= 0:
        raise ValueError(
            f"{label.name}: instance {instance.id} has no centerline; draw one to label its clip"
        )
    at = np.linspace(0.0, lengths[-1], NODES)
    xy = [(round(float(x), 2), round(float(y), 2)) for x, y in _point_at(line, lengths, at)]
    width = instance.width_px or max(float(instance.mask_rle.array().sum() / lengths[-1]), 1.0)
    first, last = (_end(point, width, label) for point in (line[0], line[-1]))
    return TrackNodes(
        id=instance.id,
        xy=xy,
        velocity=[(0.0, 0.0)] * NODES,
        seen=[True] * NODES,
        firm=[1.0] * NODES,
        spread=[0.0] * NODES,
        length_px=float(lengths[-1]),
        width_px=width,
        start_px=0.0,
        ends=(first, last),
        closed=instance.closed,
        state="seen",
        certainty=1.0,
        likely=1.0,
        score=1.0,
        missed=0,
        met=1,
    )


def _end(point: Points, width_px: float, label: PictureLabel) -> Literal["free", "border"]:
    """What a person drew up to the border goes on outside."""
    inside = min(*point, label.width - 1 - point[0], label.height - 1 - point[1])
    return "border" if inside < _BORDER_WIDTHS * width_px else "free"


def label_of_frame(
    result: InstancesResult, name: str, sha256: str, known: frozenset[int]
) -> PictureLabel:
    """What a tracked picture shows, under the track's ids; ``known`` are the ids of the corrected
    picture."""
    cables = [cable for cable in result.cables or [] if cable.state != "lost"]
    masks = _masks(result, cables)
    instances = [
        _instance(cable, mask, known)
        for cable, mask in zip(cables, masks, strict=True)
        if mask.any()
    ]
    return PictureLabel(
        name=name,
        sha256=sha256,
        width=result.width,
        height=result.height,
        instances=instances,
        origin="tracked",
        method=result.method,
        threshold=result.threshold,
        models=result.models,
    )


def _instance(
    cable: TrackedCable, mask: NDArray[np.bool_], known: frozenset[int]
) -> LabelledInstance:
    sure = min(cable.certainty, cable.score)
    return LabelledInstance(
        id=cable.id,
        score=sure if not known or cable.id in known else min(sure, _UNKNOWN_CABLE),
        centerline_xy=_longest_in_view(cable),
        width_px=cable.width_px,
        mask_rle=encode(mask),
        endpoints=[] if cable.covered else cable.endpoints,
        closed=not cable.endpoints,
    )


def _masks(result: InstancesResult, cables: Sequence[TrackedCable]) -> list[NDArray[np.bool_]]:
    """(H, W) of every cable: no pixel belongs to two."""
    size = result.height, result.width
    foreground = np.zeros(size, bool)
    for instance in result.instances:
        foreground |= instance.mask_rle.array()
    nearest, owner = np.full(size, np.inf, np.float32), np.zeros(size, np.int32)
    for k, cable in enumerate(cables, start=1):
        away = _away(cable, size)
        mine = away < np.minimum(nearest, _REACH_WIDTHS * cable.width_px)
        nearest[mine], owner[mine] = away[mine], k
    return [foreground & (owner == k) for k in range(1, len(cables) + 1)]


def _away(cable: TrackedCable, size: tuple[int, int]) -> NDArray[np.float32]:
    """(H, W) px from the stretches of ``cable`` that are in view; where none is, the picture's
    size."""
    line = np.zeros(size, np.uint8)
    for stretch in _in_view(cable):
        if len(stretch) > 1:
            cv2.polylines(
                line, [np.rint(stretch * _FINE).astype(np.int32)], False, 1, 1, cv2.LINE_8, 4
            )
    if not line.any():
        return np.full(size, float(sum(size)), np.float32)
    return np.asarray(
        cv2.distanceTransform(1 - line, cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32
    )


def _in_view(cable: TrackedCable) -> list[Points]:
    """The stretches of the centerline that are not covered."""
    points, u = np.array(cable.centerline_xy), np.linspace(0.0, 1.0, len(cable.centerline_xy))
    hidden = np.zeros(len(points), bool)
    for first, last in cable.covered:
        hidden |= (u >= first - 1e-3) & (u <= last + 1e-3)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], hidden, [True]])))
    return [points[a:b] for a, b in edges.reshape(-1, 2)]


def _longest_in_view(cable: TrackedCable) -> list[tuple[float, float]]:
    longest = max(_in_view(cable), key=len, default=np.zeros((0, 2)))
    return [(float(x), float(y)) for x, y in longest]


def _point_at(line: Points, lengths: Points, at: Points) -> Points:
    return np.stack([np.interp(at, lengths, axis) for axis in line.T], axis=1)
