"""Tracks between contracts and arrays, and the frame of an ``instances`` request that continues
one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from dlo_client.contracts import (
    CableCrossing,
    CablePosition,
    Endpoint,
    TrackedCable,
    TrackNodes,
    TrackOrder,
    TrackState,
)
from dlo_client.contracts.tracking import MOST_CABLES

from models.tracking import state
from models.tracking.course import course_of
from models.tracking.track import TrackParams, follow
from workers.stages.depth import SeenDepth, curve_fields
from workers.stages.encoding import as_point, as_points
from workers.stages.outcome import InvalidInput
from workers.stages.perception import Perception

_MOST_PX = 1e6


class Tracked(NamedTuple):
    """What a frame shows of a track, and the track after it."""

    cables: list[TrackedCable]
    crossings: list[CableCrossing]
    track: TrackState


def track_frame(
    previous: TrackState, seen: Perception, time_s: float | None, depth: SeenDepth | None = None
) -> Tracked:
    """The track with what was ``seen`` in its next picture.

    Raises InvalidInput naming ``time_s`` or ``previous``.
    """
    if time_s is not None and previous.time_s is not None and time_s < previous.time_s:
        raise InvalidInput(
            "time_s", f"is before that of the last frame, {previous.time_s:g} s", "invalid_request"
        )
    _check_ids(previous)
    source = seen.source
    mask = seen.foreground.cable
    track = follow(
        decode(previous),
        seen.scene,
        source.image,
        mask,
        TrackParams(most_cables=MOST_CABLES),
        time_s=time_s,
    )
    crossings = [_crossing(order) for order in track.crossings]
    return Tracked([_cable(cable, depth) for cable in track.cables], crossings, encode(track))


def decode(track: TrackState) -> state.Track:
    return state.Track(
        frame=track.frame,
        cables=tuple(_nodes_in(cable) for cable in track.cables),
        crossings=tuple(state.CrossingOrder(**dict(order)) for order in track.crossings),
        next_id=track.next_id,
        time_s=track.time_s,
        step_s=track.step_s,
        cover=state.Cover(track.shown_px, track.covered),
    )


def encode(track: state.Track) -> TrackState:
    return TrackState(
        frame=track.frame,
        next_id=track.next_id,
        time_s=track.time_s,
        step_s=track.step_s,
        shown_px=round(track.cover.shown_px, 1),
        covered=track.cover.covered,
        cables=[_nodes_out(cable) for cable in track.cables],
        crossings=[
            TrackOrder(
                **order._asdict() | {"xy": as_point(order.xy), "evidence": round(order.evidence, 3)}
            )
            for order in track.crossings
        ],
    )


def _check_ids(previous: TrackState) -> None:
    ids = [cable.id for cable in previous.cables]
    if len(set(ids)) < len(ids):
        raise InvalidInput("previous.cables", "two cables have the same id", "invalid_request")
    if max(ids, default=0) >= previous.next_id:
        raise InvalidInput(
            "previous.next_id", "is the id of a cable that is there", "invalid_request"
        )


def _nodes_in(cable: TrackNodes) -> state.TrackedCable:
    xy = np.array(cable.xy, float)
    return state.TrackedCable(
        id=cable.id,
        xy=xy,
        velocity=np.array(cable.velocity, float),
        seen=np.array(cable.seen, bool),
        firm=np.array(cable.firm, float),
        spread=np.array(cable.spread, float),
        course=course_of(xy) if cable.course is None else np.array(cable.course, float),
        length_px=cable.length_px,
        width_px=cable.width_px,
        ends=cable.ends,
        closed=cable.closed,
        state=cable.state,
        certainty=cable.certainty,
        likely=cable.likely,
        score=cable.score,
        missed=cable.missed,
        met=cable.met,
        adrift_px=cable.adrift_px,
        joined=cable.joined,
        doubted=cable.doubted,
        color=None if cable.color is None else np.array(cable.color),
        start_px=cable.start_px,
    )


def _nodes_out(cable: state.TrackedCable) -> TrackNodes:
    return TrackNodes(
        id=cable.id,
        xy=as_points(np.clip(cable.xy, -_MOST_PX, _MOST_PX)),
        velocity=as_points(cable.velocity),
        seen=cable.seen.tolist(),
        firm=np.round(cable.firm, 3).tolist(),
        spread=np.round(cable.spread, 2).tolist(),
        course=np.round(cable.course, 4).tolist(),
        length_px=round(cable.length_px, 2),
        width_px=round(cable.width_px, 2),
        start_px=round(cable.start_px, 2),
        ends=cable.ends,
        closed=cable.closed,
        state=cable.state,
        certainty=round(cable.certainty, 4),
        likely=round(cable.likely, 4),
        score=round(cable.score, 4),
        missed=cable.missed,
        met=cable.met,
        adrift_px=round(cable.adrift_px, 2),
        joined=cable.joined,
        doubted=cable.doubted,
        color=None if cable.color is None else as_color(cable.color),
    )


def as_color(lab: np.ndarray) -> tuple[float, float, float]:
    lightness, a, b = np.round(lab, 1).tolist()
    return lightness, a, b


def _cable(cable: state.TrackedCable, depth: SeenDepth | None) -> TrackedCable:
    metric = (
        {}
        if cable.state == "lost"
        else curve_fields(depth, cable.xy, cable.width_px, cable.covered, state.NODES)
    )
    ends = [] if cable.closed else [(cable.xy[0], cable.ends[0]), (cable.xy[-1], cable.ends[1])]
    return TrackedCable(
        id=cable.id,
        state=cable.state,
        certainty=round(cable.certainty, 4),
        instance=cable.number or None,
        centerline_xy=as_points(np.clip(cable.xy, -_MOST_PX, _MOST_PX)),
        length_px=round(cable.length_px, 2),
        width_px=round(cable.width_px, 2),
        start_px=round(cable.start_px, 2),
        covered=[(round(u0, 4), round(u1, 4)) for u0, u1 in cable.covered],
        endpoints=[
            Endpoint(xy=as_point(np.clip(xy, -_MOST_PX, _MOST_PX)), kind=kind) for xy, kind in ends
        ],
        score=round(cable.score, 4),
        **metric,
    )


def _crossing(order: state.CrossingOrder) -> CableCrossing:
    return CableCrossing(
        xy=as_point(order.xy),
        over=CablePosition(cable=order.over, u=round(order.over_u, 4)),
        under=CablePosition(cable=order.under, u=round(order.under_u, 4)),
        score=round(order.score, 4),
    )
