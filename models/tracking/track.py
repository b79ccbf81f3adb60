"""One frame more: what is seen in it is given to the cables known so far."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.polylines import arc_lengths, point_at, resample
from models.instances.scene import Scene
from models.tracking.assignment import Match, assign
from models.tracking.crossings import Place, Places, carried_on
from models.tracking.motion import expected_xy, moved
from models.tracking.state import NODES, Observation, Track, TrackedCable

_COLOR_INERTIA = 0.9
_LEFT_OVER = 0.3
"""An observation of which less belongs to known cables is a new one."""
_STEP_PX = 4.0
"""Between the points of a part of an observation."""
_WIDTH_INERTIA = 0.8


@dataclass(frozen=True)
class TrackParams:
    """A cable that is not seen is kept for ``keep_frames``, its certainty times ``fading`` every frame; what is
    first seen with a score below ``least_score`` or shorter than ``least_widths`` becomes no cable of its own."""

    keep_frames: int = 300
    fading: float = 0.995
    least_score: float = 0.3
    least_widths: float = 4.0


def follow(track: Track, scene: Scene, image: ByteArray | None = None, params: TrackParams | None = None) -> Track:
    """The track after a frame whose ``scene`` was found in ``image`` (H, W, 3) RGB."""
    params = params or TrackParams()
    observations = observe(scene, image)
    expected = [expected_xy(cable) for cable in track.cables]
    parts = [part for observed in observations for part in cut_at_crossings(observed, scene)]
    matches = assign(track.cables, expected, observations, parts)
    cables = [
        _met(cable, expected[i], matches[i]) if i in matches else _missed(cable, expected[i], params)
        for i, cable in enumerate(track.cables)
    ]
    cables = [cable for cable in cables if cable.missed <= params.keep_frames]
    used = _used(matches)
    new = [
        _new(track.next_id + k, observed)
        for k, observed in enumerate(o for o in observations if used[o.number] < _LEFT_OVER and _worth(o, params))
    ]
    known = (*cables, *new)
    places = _places(matches, track.cables, new)
    crossings = carried_on(track.crossings, scene, known, places)
    return Track(track.frame + 1, known, crossings, track.next_id + len(new))


def observe(scene: Scene, image: ByteArray | None) -> list[Observation]:
    """The instances of a scene, with their colors where there is a picture."""
    lab = np.asarray(cv2.cvtColor(image, cv2.COLOR_RGB2LAB), np.uint8) if image is not None else None
    return [
        Observation(
            number=number,
            xy=item.centerline_xy,
            length_px=item.length_px,
            width_px=max(item.width_px, 1.0),
            ends=(item.endpoints[0].kind, item.endpoints[-1].kind)
            if len(item.endpoints) == 2
            else ("hidden", "hidden"),
            closed=item.closed,
            score=item.score,
            color=_color(lab, item.centerline_xy) if lab is not None else None,
        )
        for number, item in enumerate(scene.instances, start=1)
        if len(item.centerline_xy) > 1 and item.length_px > 0
    ]


def cut_at_crossings(observed: Observation, scene: Scene) -> list[Observation]:
    """The parts of an observation between its crossings; parts shorter than its width are left out."""
    places = [p.u for c in scene.crossings for p in (c.over, c.under) if p.instance == observed.number]
    cuts = np.concatenate([[0.0], np.sort(np.clip(places, 0.0, 1.0)), [1.0]])
    lengths = arc_lengths(observed.xy)
    parts = []
    for k, (first, last) in enumerate(pairwise(cuts)):
        length = float(last - first) * observed.length_px
        if length < observed.width_px:
            continue
        wanted = np.linspace(first, last, max(int(length / _STEP_PX), 2)) * lengths[-1]
        ends = (
            observed.ends[0] if k == 0 else "hidden",
            observed.ends[1] if k == len(cuts) - 2 else "hidden",
        )
        xy = point_at(observed.xy, lengths, wanted)
        parts.append(replace(observed, xy=xy, length_px=length, ends=ends, span=(float(first), float(last))))
    return parts


def _color(lab: ByteArray, xy: FloatArray) -> FloatArray:
    column, row = np.rint(xy).astype(int).T
    inside = lab[row.clip(0, lab.shape[0] - 1), column.clip(0, lab.shape[1] - 1)].astype(float)
    # OpenCV stretches lightness to 0 … 255 and shifts a and b by 128.
    return np.asarray(np.median(inside, axis=0) * (100 / 255, 1.0, 1.0) - (0, 128, 128))


def _used(matches: dict[int, Match]) -> Counter[int]:
    """By the observation's number: the share of it that known cables took."""
    used: Counter[int] = Counter()
    for match in matches.values():
        for observed, _ in match.pieces:
            used[observed.number] += observed.span[1] - observed.span[0]  # type: ignore[assignment]
    return used


def _met(cable: TrackedCable, expected: FloatArray, match: Match) -> TrackedCable:
    main = match.pieces[0].observed
    after = moved(cable, expected, match.pieces)
    color = main.color
    if color is not None and cable.color is not None:
        color = _COLOR_INERTIA * cable.color + (1 - _COLOR_INERTIA) * color
    return replace(
        after,
        color=color if color is not None else cable.color,
        width_px=_WIDTH_INERTIA * cable.width_px + (1 - _WIDTH_INERTIA) * main.width_px,
        certainty=cable.certainty * match.probability,
        score=main.score,
        number=main.number,
    )


def _missed(cable: TrackedCable, expected: FloatArray, params: TrackParams) -> TrackedCable:
    return replace(
        cable,
        xy=expected,
        seen=np.zeros(NODES, bool),
        state="lost",
        certainty=cable.certainty * params.fading,
        missed=cable.missed + 1,
        number=0,
    )


def _new(number: int, observed: Observation) -> TrackedCable:
    return TrackedCable(
        id=number,
        xy=resample(observed.xy, NODES),
        velocity=np.zeros((NODES, 2)),
        seen=np.ones(NODES, bool),
        length_px=observed.length_px,
        width_px=observed.width_px,
        ends=observed.ends,
        closed=observed.closed,
        state="new",
        certainty=1.0,
        score=observed.score,
        number=observed.number,
        color=observed.color,
    )


def _worth(observed: Observation, params: TrackParams) -> bool:
    return observed.score >= params.least_score and observed.length_px >= params.least_widths * observed.width_px


def _places(matches: dict[int, Match], cables: Sequence[TrackedCable], new: Sequence[TrackedCable]) -> Places:
    """By the observation's number: which parts of it are where on which cable."""
    places: Places = defaultdict(list)
    for cable in new:
        places[cable.number].append(Place(0.0, 1.0, cable.id, 0.0, 1.0))
    for i, match in matches.items():
        for observed, at in match.pieces:
            first, last = at.start / cables[i].length_px, at.stop / cables[i].length_px
            if at.reverse:
                first, last = last, first
            places[observed.number].append(Place(*observed.span, cables[i].id, first, last))
    return places
