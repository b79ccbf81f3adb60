"""From ordered points along each DLO to the finished scene; shared by the instance methods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from models.geometry.painting import stroke
from models.geometry.polylines import arc_lengths, resample
from models.geometry.sampling import read_nearest
from models.geometry.splines import fit_spline
from models.instances.confidence import (
    crossing_features,
    evidence_of,
    instance_features,
    order_features,
    rated,
    rated_crossings,
    typical_width,
)
from models.instances.crossings import Meeting, Strand, find_meetings, order_meetings
from models.instances.drawing import MAX_INSTANCES, draw_labels
from models.instances.edges import edge_shifts
from models.instances.endpoints import endpoints_of
from models.instances.scene import Crossing, Instance, Scene
from models.strands.chain import Chain
from models.strands.ends import beyond, width_of
from models.strands.stopwatch import Stopwatch

_POINT_SPACING_PX = 5.0
_ONE_PLACE_PX = 1e-6
_FITTED_PX = 3.0
"""Nearer points than this, on average, are thinned out before a spline is fitted: a skeleton has
one a pixel."""
_TIP_POINTS = 3
"""So many of these show the direction of an end."""
_TIP_WIDTHS = 1.5
"""A skeleton ends up to a width and a half before the strand does."""
_POINTS_A_SPAN = 8
_TOLERANCE_PX = 1.0
"""Root mean square distance of the spline to the points it is fitted to."""
SHORTEST_WIDTHS = 3.0
"""Shorter things are not called DLOs; in widths of the scene's typical DLO."""
_LEAST_SCORE = 0.5
_LONG_WIDTHS = 15.0
"""What is less likely a DLO than not is left out, unless it is so long (in widths of the scene's
typical DLO): then it is kept and called unsure."""
_COVERED = 0.6
"""Share of a centerline that may lie on a longer DLO before it counts as a part of that one."""

Order = Callable[[list[Meeting], list[Strand], ByteArray | None], tuple[Crossing, ...]]


def assemble(
    chains: list[Chain],
    mask: BoolArray,
    distances: Float32Array,
    image: ByteArray | None,
    watch: Stopwatch,
    *,
    method: str,
    follow_edges: bool = False,
    order: Order = order_meetings,
) -> Scene:
    """Splines, widths, endpoints, crossings and labels of the chains, longest first.

    What is too short for a DLO, or is on another one, is left out; at most 255 instances remain.
    With ``follow_edges`` outlines and widths are those of the picture, where it shows them near the
    mask's. ``order``: what decides which strand is on top. ``method``: whose calibration turns
    evidence into probabilities; what is short and less likely a DLO than not is left out. ``watch``
    measures the steps.
    """
    with watch.step("splines"):
        fits = ((_fit(c, mask, distances), c.doubt) for c in chains)
        fitted = [(found, doubt) for found, doubt in fits if found is not None]
        instances, doubts = _without_fragments(fitted, mask.shape)
        shifts = None
        if follow_edges and image is not None:
            shifts = edge_shifts(instances, distances, image)
            widths = [max(1.0, i.width_px + 2 * s) for i, s in zip(instances, shifts, strict=True)]
            instances = [replace(i, width_px=w) for i, w in zip(instances, widths, strict=True)]
    with watch.step("crossings"):
        evidence = evidence_of(instances, doubts, mask, image)
        ends = endpoints_of(instances, mask.shape)
        seen = instance_features(instances, ends, evidence)
        rough = rated(instances, ends, evidence, seen, method)
        likely = _likely(rough, in_doubt=1 if image is None else 0)
        instances = [rough[k] for k in likely]
        shifts = None if shifts is None else shifts[likely]
        strands = [Strand.of(i.centerline_xy, i.width_px) for i in instances]
        meetings = find_meetings(strands)
        raw = order(meetings, strands, image)
        existence, order_seen = crossing_features(meetings, instances), order_features(raw)
        crossings = rated_crossings(raw, existence, order_seen, method)
        if len(likely) < len(rough):
            ends = endpoints_of(instances, mask.shape)
    with watch.step("labels"):
        finished = tuple(replace(i, endpoints=e) for i, e in zip(instances, ends, strict=True))
        labels = draw_labels(mask, finished, crossings, shifts)
    features = {"instance": seen[likely], "crossing": existence, "order": order_seen}
    return Scene(finished, crossings, labels, watch.timings_ms, features)


def _likely(instances: list[Instance], in_doubt: int) -> list[int]:
    """Those that are more likely a DLO than not, or so long that they are kept and called unsure.

    Without any, the ``in_doubt`` longest: a mask without a picture was made by somebody who means a
    DLO.
    """
    long = _LONG_WIDTHS * typical_width(instances)
    likely = [k for k, i in enumerate(instances) if i.score >= _LEAST_SCORE or i.length_px >= long]
    return likely or list(range(min(in_doubt, len(instances))))


def _fit(chain: Chain, mask: BoolArray, distances: Float32Array) -> Instance | None:
    """The instance of one chain, or None if it is too short for its own width; its score is the
    share of it on foreground until it is rated."""
    width = width_of(read_nearest(distances, chain.xy))
    points = (
        np.concatenate((chain.xy, chain.xy[:1]))
        if chain.closed
        else _to_the_tips(chain.xy, mask, _TIP_WIDTHS * width)
    )
    lengths = arc_lengths(points)
    rough_length = float(lengths[-1])
    if rough_length < SHORTEST_WIDTHS * width:
        return None
    spline = fit_spline(
        _thinned(points, lengths), tolerance_px=_TOLERANCE_PX, spans=len(points) // _POINTS_A_SPAN
    )
    count = max(2, round(rough_length / _POINT_SPACING_PX) + 1)
    centerline = resample(spline.at(np.linspace(0, 1, 2 * count)), count)
    length = float(arc_lengths(centerline)[-1])
    score = float(read_nearest(mask, centerline).mean())
    return Instance(centerline, width, length, chain.closed, spline, (), score)


def _thinned(points: FloatArray, lengths: FloatArray) -> FloatArray:
    """Every so many of the points, about ``_FITTED_PX`` apart, no two neighbors at one place, the
    last one included; of a small ring, whose last point is its first, at least three."""
    every = max(1, min(round(_FITTED_PX * (len(points) - 1) / lengths[-1]), (len(points) - 1) // 3))
    kept = np.append(np.arange(0, len(points) - 1, every), len(points) - 1)
    return points[kept[np.append(True, np.diff(lengths[kept]) > _ONE_PLACE_PX)]]


def _to_the_tips(points: FloatArray, mask: BoolArray, most: float) -> FloatArray:
    """The points with both ends moved on along the strand while there is foreground, at most so
    many pixels.

    Maxima of a distance transform end half a width before the strand does.
    """
    first, last = (beyond(way, mask, most, _TIP_POINTS) for way in (points, points[::-1]))
    return np.concatenate((first, points, last))


def _without_fragments(
    fitted: list[tuple[Instance, float]], shape: tuple[int, ...]
) -> tuple[list[Instance], list[float]]:
    """The instances and their doubts, longest first, without short ones and those that lie on a
    longer one."""
    ordered = sorted(fitted, key=lambda pair: -pair[0].length_px)
    typical = typical_width([instance for instance, _ in ordered])
    taken = np.zeros(shape, dtype=np.uint8)
    kept: list[Instance] = []
    doubts: list[float] = []
    for instance, doubt in ordered:
        if instance.length_px < SHORTEST_WIDTHS * max(typical, instance.width_px):
            continue
        if (
            read_nearest(taken, instance.centerline_xy).mean() < _COVERED
            and len(kept) < MAX_INSTANCES
        ):
            stroke(taken, instance.centerline_xy, 1, instance.width_px)
            kept.append(instance)
            doubts.append(doubt)
    return kept, doubts
