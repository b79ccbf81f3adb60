"""One frame more: what is seen in it is given to the cables known so far."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from models.geometry.colors import LAB_OF_A_LEVEL
from models.geometry.polylines import resample
from models.instances.scene import EndpointKind, Instance, Scene
from models.tracking.assignment import Match, assign, assign_certain
from models.tracking.course import course_of
from models.tracking.covering import cover_after
from models.tracking.crossings import Place, Places, carried_on
from models.tracking.motion import DAMPING, adrift, expected_xy, moved, wider
from models.tracking.ownership import Run, Samples, sample
from models.tracking.registration import registered
from models.tracking.regrouping import cut
from models.tracking.state import NODES, Observation, Track, TrackedCable

T = TypeVar("T", BoolArray, ByteArray, FloatArray)

_COLOR_INERTIA = 0.9
_LEFT_OVER = 0.7
"""A stretch that nobody owns is a new cable if it is so much of its observation: shorter ones are
parts of others."""
_COLORED = 64
"""So many points of an observation, or up to twice as many, tell its color."""
_WIDTH_INERTIA = 0.8
_BORDER_WIDTHS = 1.5
"""An end so near to the picture's border may be at it."""
_LEAST_LIKELY = 1e-6
_THICK = 0.75
"""Half the width of the foreground, in widths, from which there is more than one strand."""
_FRAMES, _STEP_INERTIA = (0.1, 10.0), 0.9
"""So many usual frames at least and at most are between two; share of the usual time that stays."""
_REGROUPED = 3
"""So often a frame is looked at again after cables were cut."""
_REMEMBERED = 15
"""A cable is kept for so many frames for every one in which it was met …"""
_MOSTLY_FIRM = 0.5
"""… if at least so much of it was ever seen alone: else it may never have been one, and is
forgotten at once."""


@dataclass(frozen=True)
class TrackParams:
    """A cable that is not seen is kept for ``keep_frames``, its certainty times ``fading`` every
    frame; what is first seen with a score below ``least_score`` or shorter than ``least_widths``
    becomes no cable of its own. Of more than ``most_cables``, those that have been away longest are
    forgotten."""

    keep_frames: int = 300
    fading: float = 0.995
    least_score: float = 0.3
    least_widths: float = 4.0
    most_cables: int = 100


def follow(
    track: Track,
    scene: Scene,
    image: ByteArray | None = None,
    mask: BoolArray | None = None,
    params: TrackParams | None = None,
    time_s: float | None = None,
) -> Track:
    """The track after a frame whose ``scene`` was found in ``image`` (H, W, 3) RGB and its
    foreground ``mask`` (H, W). Without a mask, what the instances bridged is taken for seen.
    ``time_s`` is when it was taken: without, frames are equally far apart."""
    params = params or TrackParams()
    observations = observe(scene, image, mask)
    frames, step_s = _elapsed(track, time_s)
    samples = sample(observations) if observations else None
    predicted = [expected_xy(cable, frames) for cable in track.cables]
    cover = cover_after(track, observations, samples, predicted, scene.labels.shape[:2])
    given = _given_certain if cover.covered else _given
    shared = given(track.cables, frames, observations, samples)
    cables = [
        _met(
            cable,
            shared.predicted[i],
            shared.expected[i],
            shared.matches[i],
            frames,
            params,
            cover.covered,
        )
        if i in shared.matches
        else _missed(cable, shared.expected[i], params)
        for i, cable in enumerate(shared.cables)
    ]
    cables = [
        cable for cable in cables if cable.missed <= min(params.keep_frames, _patience(cable))
    ]
    new = [
        _new(track.next_id + k, run)
        for k, run in enumerate(run for run in shared.left if _worth(run, params))
    ]
    known = tuple(sorted((*cables, *new), key=lambda cable: cable.missed)[: params.most_cables])
    known = tuple(sorted(known, key=lambda cable: cable.id))
    crossings = carried_on(
        track.crossings, scene, known, _places(shared.matches, shared.cables, new)
    )
    return Track(track.frame + 1, known, crossings, track.next_id + len(new), time_s, step_s, cover)


class _Shared(NamedTuple):
    """Which of the ``cables``, ``predicted`` and ``expected`` (NODES, 2) each, are where in the
    picture: ``matches`` by index; ``left`` what is none of them."""

    cables: Sequence[TrackedCable]
    predicted: Sequence[FloatArray]
    expected: Sequence[FloatArray]
    matches: dict[int, Match]
    left: Sequence[Run]


def _given(
    cables: Sequence[TrackedCable],
    frames: float,
    observations: Sequence[Observation],
    samples: Samples | None,
) -> _Shared:
    """All that the picture shows is given to the cables, so many usual frames later."""
    before = list(cables)
    for rounds in range(_REGROUPED, 0, -1):
        predicted = [expected_xy(cable, frames) for cable in before]
        expected = registered(before, predicted, samples)
        matches, left, changed = assign(before, expected, observations, samples)
        if not changed or rounds == 1:
            break
        before = [
            cable if i not in changed else cut(cable, kept)
            for i, cable in enumerate(before)
            if (kept := changed.get(i, (0.0, 0.0))) is not None
        ]
    return _Shared(before, predicted, expected, matches, left)


def _given_certain(
    cables: Sequence[TrackedCable],
    frames: float,
    observations: Sequence[Observation],
    samples: Samples | None,
) -> _Shared:
    """The same in a picture where something covers the cables: only what is certainly theirs, and
    new is only what is far from all of them."""
    predicted = [expected_xy(cable, frames) for cable in cables]
    expected = registered(cables, predicted, samples)
    matches, left = assign_certain(cables, expected, observations, samples)
    return _Shared(cables, predicted, expected, matches, left)


def _elapsed(track: Track, time_s: float | None) -> tuple[float, float | None]:
    """Usual frames since the last one, and the usual time between two."""
    if time_s is None or track.time_s is None:
        return 1.0, track.step_s
    step = max(time_s - track.time_s, 0.0)
    if not track.step_s:
        return 1.0, step
    frames = float(np.clip(step / track.step_s, *_FRAMES))
    return frames, _STEP_INERTIA * track.step_s + (1 - _STEP_INERTIA) * step


def observe(scene: Scene, image: ByteArray | None, mask: BoolArray | None) -> list[Observation]:
    """The instances of a scene, with their colors where there is a picture."""
    depth = None if mask is None else _to_edge(mask)
    crossings: dict[int, list[float]] = defaultdict(list)
    for crossing in scene.crossings:
        for position in (crossing.over, crossing.under):
            crossings[position.instance].append(position.u)
    out = []
    for number, item in enumerate(scene.instances, start=1):
        if len(item.centerline_xy) < 2 or item.length_px <= 0:
            continue
        color, mottled = (None, 0.0) if image is None else _color(image, item.centerline_xy)
        out.append(
            Observation(
                number=number,
                xy=item.centerline_xy,
                length_px=item.length_px,
                width_px=max(item.width_px, 1.0),
                ends=_ends(item, scene.labels.shape),
                closed=item.closed,
                score=item.score,
                color=color,
                mottled=mottled,
                crossings=tuple(crossings[number]),
                bridged=None if mask is None else ~_looked_up(mask, item.centerline_xy),
                leaves=_at_border(item, scene.labels.shape),
                thick=None
                if depth is None
                else _looked_up(depth, item.centerline_xy) > _THICK * item.width_px,
            )
        )
    return out


def _to_edge(mask: BoolArray) -> FloatArray:
    """(H, W) px from every foreground pixel to the nearest that is none."""
    return np.asarray(cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 3))


def _ends(item: Instance, size: tuple[int, ...]) -> tuple[EndpointKind, EndpointKind]:
    """Kinds of both ends. One that is free, but hardly inside the picture, may go on outside."""
    if len(item.endpoints) != 2:
        return "hidden", "hidden"
    margin = _BORDER_WIDTHS * item.width_px
    kinds: list[EndpointKind] = []
    for end in item.endpoints:
        inside = min(*end.xy, size[1] - 1 - end.xy[0], size[0] - 1 - end.xy[1])
        kinds.append("border" if end.kind == "free" and inside < margin else end.kind)
    return kinds[0], kinds[1]


def _at_border(item: Instance, size: tuple[int, ...]) -> BoolArray:
    """(n,) which points are so near to the picture's border that the strand may go on outside."""
    inside = np.minimum(item.centerline_xy, (size[1] - 1, size[0] - 1) - item.centerline_xy).min(1)
    return np.asarray(inside < item.width_px)


def _color(image: ByteArray, xy: FloatArray) -> tuple[FloatArray, float]:
    """Mean CIE Lab at ``xy`` (n, 2), and how far from it its pixels usually are."""
    some = xy[:: max(len(xy) // _COLORED, 1)]
    lab = cv2.cvtColor(_looked_up(image, some)[None], cv2.COLOR_RGB2LAB)[0]
    # OpenCV stretches lightness to 0 … 255 and shifts a and b by 128.
    values = lab * LAB_OF_A_LEVEL - (0, 128, 128)
    mean = values.mean(0)
    return np.asarray(mean), float(np.linalg.norm(values - mean, axis=1).mean())


def _looked_up(picture: T, xy: FloatArray) -> T:
    """``picture`` (H, W) or (H, W, 3) at the pixels nearest to ``xy`` (n, 2), on its border where
    they are outside."""
    column, row = np.rint(xy).astype(int).T
    return np.asarray(
        picture[row.clip(0, picture.shape[0] - 1), column.clip(0, picture.shape[1] - 1)]
    )


def _met(
    cable: TrackedCable,
    predicted: FloatArray,
    on: FloatArray,
    match: Match,
    frames: float,
    params: TrackParams,
    covered: bool,
) -> TrackedCable:
    """The cable after a frame that showed it, ``covered`` as of
    :func:`models.tracking.motion.moved`; one whose pieces are all shorter than its nodes are apart
    was missed."""
    main = match.pieces[0].observed
    after = moved(cable, predicted, on, match.pieces, match.goes_on, frames, covered)
    if not after.seen.any():
        return _missed(cable, on, params)
    color = main.color
    if color is not None and cable.color is not None:
        color = _COLOR_INERTIA * cable.color + (1 - _COLOR_INERTIA) * color
    return replace(
        after,
        color=color if color is not None else cable.color,
        width_px=_WIDTH_INERTIA * cable.width_px + (1 - _WIDTH_INERTIA) * main.width_px,
        certainty=cable.certainty * min(match.probability / max(cable.likely, _LEAST_LIKELY), 1.0),
        likely=match.probability,
        score=main.score,
        number=main.number,
        joined=cable.joined + 1 if match.joined else max(cable.joined - 1, 0),
    )


def _missed(cable: TrackedCable, expected: FloatArray, params: TrackParams) -> TrackedCable:
    nothing = np.zeros(NODES, bool)
    return replace(
        cable,
        xy=expected,
        velocity=DAMPING * cable.velocity,
        seen=nothing,
        spread=wider(cable, nothing),
        adrift_px=adrift(cable),
        state="lost",
        certainty=cable.certainty * params.fading,
        missed=cable.missed + 1,
        number=0,
    )


def _new(number: int, run: Run) -> TrackedCable:
    observed = run.observed
    whole = run.along[0] <= 0, run.along[-1] >= observed.length_px * (1 - 1e-3)
    return TrackedCable(
        id=number,
        xy=resample(run.xy, NODES),
        velocity=np.zeros((NODES, 2)),
        seen=np.ones(NODES, bool),
        firm=np.interp(np.linspace(0, 1, NODES), np.linspace(0, 1, len(run.trust)), run.trust),
        spread=np.zeros(NODES),
        course=course_of(resample(run.xy, NODES)),
        length_px=run.length_px,
        width_px=observed.width_px,
        ends=(
            observed.ends[0] if whole[0] else "hidden",
            observed.ends[1] if whole[1] else "hidden",
        ),
        closed=observed.closed and all(whole),
        state="new",
        certainty=1.0,
        score=observed.score,
        number=observed.number,
        color=observed.color,
    )


def _patience(cable: TrackedCable) -> int:
    """Frames for which a cable that is away is remembered."""
    return _REMEMBERED * cable.met if float((cable.firm >= 1).mean()) >= _MOSTLY_FIRM else 0


def _worth(run: Run, params: TrackParams) -> bool:
    """Whether a run that no cable owns is a cable of its own."""
    observed = run.observed
    if len(run.along) < 2 or observed.score < params.least_score:
        return False
    return run.length_px >= max(
        params.least_widths * observed.width_px, _LEFT_OVER * observed.length_px
    )


def _places(
    matches: dict[int, Match], cables: Sequence[TrackedCable], new: Sequence[TrackedCable]
) -> Places:
    """By the observation's number: which parts of it are where on which cable."""
    places: Places = defaultdict(list)
    for cable in new:
        places[cable.number].append(Place(0.0, 1.0, cable.id, 0.0, 1.0))
    for i, match in matches.items():
        for piece in match.pieces:
            at = piece.position[[0, -1]] / cables[i].length_px
            ends = sorted([(piece.u0, float(at[0])), (piece.u1, float(at[1]))])
            places[piece.observed.number].append(
                Place(ends[0][0], ends[1][0], cables[i].id, ends[0][1], ends[1][1])
            )
    return places
