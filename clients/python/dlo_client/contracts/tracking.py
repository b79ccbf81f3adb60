"""Cables that keep their ids from one picture to the next: options, the state between two frames,
and the answer.

The state holds everything that is known of a track: whoever sends it back with the next picture
needs no session.
"""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Point, Probability, Reply, Taken
from dlo_client.contracts.cameras import AnyIntrinsics, Pose
from dlo_client.contracts.depth import MetricCenterline
from dlo_client.contracts.foreground import ForegroundOptions
from dlo_client.contracts.images import ImagePart
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod, MethodParams
from dlo_client.contracts.objects import Endpoint

NODES = 48
"""Places on a cable that a track follows."""
MOST_CABLES = 100
"""Of one track; those that have been away longest are forgotten first."""
CableState = Literal["seen", "partly_covered", "lost", "new"]
TimeSeconds = Annotated[float, Field(ge=0, le=1e12)]
CableId = Annotated[int, Field(ge=1, le=10**9)]
EndKind = Literal["free", "border", "hidden"]
_Pixels = Annotated[float, Field(ge=0, le=1e6)]
_Shift = Annotated[float, Field(ge=-1e5, le=1e5)]
_PerNode = Field(min_length=NODES, max_length=NODES)
_Frames = Annotated[int, Field(ge=-(10**9), le=10**9)]


class TrackNodes(Taken):
    """A cable between two frames, at 48 places of equal arc length."""

    id: CableId = Field(description="it keeps this id")
    xy: Annotated[list[Point], _PerNode] = Field(
        description="where its nodes are, or are supposed to be, pixels"
    )
    velocity: Annotated[list[tuple[_Shift, _Shift]], _PerNode] = Field(
        description="of its nodes, pixels a frame"
    )
    seen: Annotated[list[bool], _PerNode] = Field(description="which nodes are in view")
    firm: Annotated[list[Probability], _PerNode] = Field(
        description="probability that the cable goes on at each node"
    )
    spread: Annotated[list[_Pixels], _PerNode] = Field(
        description="pixels by which each node may be elsewhere"
    )
    course: list[Annotated[float, Field(ge=-1e3, le=1e3)]] | None = Field(
        default=None,
        min_length=NODES - 1,
        max_length=NODES - 1,
        description="direction from each node to the next as many frames showed it, radians; default: that of `xy`",
    )
    length_px: float = Field(gt=0, le=1e7, description="from its first to its last node")
    width_px: float = Field(gt=0, le=1e5, description="running mean")
    start_px: float = Field(
        ge=-1e7, le=1e7, description="arc length of the first node, see TrackedCable"
    )
    ends: tuple[EndKind, EndKind] = Field(description="what is known of its first and last end")
    closed: bool = Field(description="whether it is a ring")
    state: CableState = Field(description="in the last frame")
    certainty: Probability = Field(description="that this is the cable which first had the id")
    likely: Probability = Field(
        description="the same of the last frame alone: a doubt that goes on counts once"
    )
    score: Probability = Field(description="score of the instance that it was last seen as")
    missed: int = Field(ge=0, le=10**9, description="how many frames since it was last seen")
    met: int = Field(ge=0, le=10**9, description="how many frames showed it")
    adrift_px: _Pixels = Field(
        default=0.0,
        description="pixels by which it may have slid along itself since an end of it was seen",
    )
    joined: int = Field(
        default=0,
        ge=0,
        le=10**9,
        description="how many frames more than not joined it to another known cable",
    )
    doubted: tuple[_Frames, _Frames] = Field(
        default=(0, 0),
        description="how many frames in a row showed its first and last end elsewhere, less those that confirmed it",
    )
    color: tuple[float, float, float] | None = Field(
        default=None, description="running mean, in units of CIE Lab"
    )


class TrackOrder(Taken):
    """Which of two cables is on top, gathered over the frames."""

    over: CableId = Field(description="id of the cable on top")
    under: CableId = Field(description="id of the cable below")
    over_u: Probability = Field(description="where on the upper cable, 0 to 1 by arc length")
    under_u: Probability = Field(description="where on the lower cable, 0 to 1 by arc length")
    xy: Point = Field(description="in the last frame that showed it, pixels")
    evidence: float = Field(
        ge=-100, le=100, description="log odds (no unit) that the order is right"
    )


class TrackState(Taken):
    """All that is known of a sequence of pictures: ``{}`` begins one."""

    frame: int = Field(default=0, ge=0, le=10**9, description="how many frames so far")
    next_id: CableId = Field(default=1, description="id of the next new cable")
    time_s: TimeSeconds | None = Field(
        default=None, description="of the last frame, if it was given"
    )
    step_s: TimeSeconds | None = Field(
        default=None, description="running mean of the time between two frames"
    )
    shown_px: float = Field(
        default=0.0,
        ge=0,
        le=1e9,
        description="length of all strands in view, the most of late, pixels",
    )
    covered: bool = Field(
        default=False,
        description="whether something lies over a part of the cables, an arm or a hand: until it is gone, only what "
        "is certainly a cable's is given to it, and new is only what is far from all of them",
    )
    cables: list[TrackNodes] = Field(
        default_factory=list, max_length=MOST_CABLES, description="met so far"
    )
    crossings: list[TrackOrder] = Field(
        default_factory=list, max_length=1000, description="met so far"
    )


class TrackedCable(MetricCenterline):
    """One cable in one frame; with depth, one that is in view has its curve in meters."""

    id: CableId = Field(description="id, the same in every frame")
    state: CableState = Field(
        description="`seen` (nearly) whole; `partly_covered`: some of it is out of view; `lost`: all of it is, and the "
        "centerline is where it is supposed to be; `new`: met for the first time"
    )
    certainty: Probability = Field(description="that this is the cable which first had the id")
    instance: int | None = Field(
        default=None, description="id of the instance that most of it is on; null when lost"
    )
    centerline_xy: list[Point] = Field(
        description="48 points at equal arc length, always from the same end: a point stays the same place on the cable"
    )
    length_px: float = Field(description="arc length of the centerline, pixels")
    width_px: float = Field(description="pixels")
    start_px: float = Field(
        description="arc length of the first point, counted from where the cable began when it was first met: below 0 "
        "once more of it came into view there. A place keeps its arc length"
    )
    covered: list[tuple[Probability, Probability]] = Field(
        description="stretches out of view, from share u0 to u1 of its length: covered, or outside the picture"
    )
    endpoints: list[Endpoint] = Field(description="its first and last end; none of a ring")
    score: Probability = Field(description="score of the instance that it was last seen as")


class CablePosition(Reply):
    """A place on a tracked cable."""

    cable: CableId = Field(description="its id")
    u: Probability = Field(
        description="share of the arc length: 0 at its first to 1 at its last point"
    )


class CableCrossing(Reply):
    """Where one tracked cable passes over another, or over itself."""

    xy: Point = Field(description="pixels; where it was last seen if it is covered")
    over: CablePosition = Field(description="the strand on top")
    under: CablePosition = Field(description="the strand below")
    score: Probability = Field(
        description="probability that the order is right, from all frames so far"
    )


class FrameResult(Reply):
    """What one picture of a track shows."""

    frame: int = Field(ge=1, description="number of the frame, from 1")
    time_s: float | None = Field(default=None, description="as it was sent with the frame")
    width: int = Field(description="of the upright picture, pixels")
    height: int = Field(description="of the upright picture, pixels")
    cables: list[TrackedCable] = Field(description="all that are known, also those that are lost")
    crossings: list[CableCrossing] = Field(description="between the cables")
    track: TrackState = Field(
        description="to be sent as `previous` with the next picture, where there is no session"
    )


class StreamedFrame(FrameResult):
    """A frame result as it is streamed."""

    number: int | None = Field(default=None, description="of the picture, as it was sent with it")
    dropped: int = Field(
        ge=0, description="how many pictures were passed over since the answer before"
    )


class TrackOptions(ForegroundOptions):
    """How the frames of a track are looked at: as in an ``instances`` request; a ``reference`` is
    uploaded before."""

    method: InstanceMethod = Field(
        default=DEFAULT_METHOD, description="how instances are told apart"
    )
    threshold: Probability | None = Field(default=None, description="default: the network's own")
    params: MethodParams | None = Field(default=None, description="those of `method`")
    intrinsics: AnyIntrinsics | None = Field(
        default=None, description="of the camera, for frames with a `depth` part"
    )
    T_world_camera: Pose | None = Field(
        default=None, description="where the camera is, for frames with a `depth` part"
    )
    timeout_s: float = Field(
        default=20.0, gt=0, le=60, description="for each frame, from acceptance to its answer"
    )
    label: str | None = Field(default=None, max_length=200, description="echoed in the track")

    @model_validator(mode="after")
    def _uploaded(self) -> TrackOptions:
        if any(isinstance(picture, ImagePart) for picture in self.reference):
            raise ValueError("`reference` is the id of an uploaded picture: a track has no parts")
        return self


class TrackInfo(Reply):
    """A session of pictures, kept by the service until no frame has come for a while."""

    id: str = Field(description="32 hexadecimal digits")
    label: str | None = Field(default=None, description="as in its options")
    options: TrackOptions = Field(description="as they were sent")
    frames: int = Field(ge=0, description="how many were answered so far")
    cables: int = Field(ge=0, description="how many are known now")
    created_at: datetime = Field(description="begun")
    expires_at: datetime = Field(description="then it is forgotten, unless a frame comes before")
