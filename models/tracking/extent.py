"""How long a cable is, where pictures go on to show another end than the one that is known.

Strategy: a cable that is met in a tangle may be known too short, because a piece of it was taken
for the whole, or too long, because a piece of another one was joined to it. A single picture errs
alike. So an end is put elsewhere only after some frames in a row have shown it there, and more of
them than have confirmed it before: a strand that goes on beyond it, or one that ends in the open
before it. Under an arm this may shorten a cable, too; once the arm is gone, the strand goes on and
is its own again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from models.tracking.placing import Piece, end_kind
from models.tracking.regrouping import cut
from models.tracking.state import TrackedCable

_ELSEWHERE_WIDTHS = 2.5
"""An end that is seen so far from the known one is another one."""
_PERSISTENT, _MOST_CONFIRMED = 6, 60
"""So many frames in a row turn over what is known of an end, and one more for each that confirmed
it, up to so many."""
_GOES_ON = 3
"""A strand that goes on weighs so many ends that confirmed: an end in the open may be where an arm
begins."""
_LEAST_WIDTHS = 4.0
"""No cable is made shorter than this."""


def revised(
    cable: TrackedCable, pieces: Sequence[Piece], goes_on: tuple[bool, bool]
) -> TrackedCable:
    """The cable with its ends where ``pieces`` of it have shown them for long enough; ``goes_on``
    whether a strand that no cable owns follows on its first and its last piece."""
    if cable.closed:
        return cable
    first, last = (
        min(pieces, key=lambda p: p.position[0]),
        max(pieces, key=lambda p: p.position[-1]),
    )
    away = -float(first.position[0]), float(last.position[-1]) - cable.length_px
    free = end_kind(first, first.u0) == "free", end_kind(last, last.u1) == "free"
    limit = _ELSEWHERE_WIDTHS * cable.width_px
    ends, counts, kept = list(cable.ends), list(cable.doubted), [0.0, cable.length_px]
    for k in (0, 1):
        near = abs(away[k]) < limit
        longer = cable.ends[k] == "free" and (away[k] > limit or (goes_on[k] and near))
        shorter = away[k] < -limit and free[k] and not goes_on[k]
        confirmed = int(cable.ends[k] == "free" and free[k] and near)
        if longer or shorter:
            counts[k] += _GOES_ON if longer and counts[k] < 0 else 1
        else:
            counts[k] = max(min(counts[k], 0) - confirmed, -_MOST_CONFIRMED)
        if counts[k] >= _PERSISTENT:
            counts[k] = 0
            ends[k] = "hidden" if longer else "free"
            kept[k] += shorter * (away[k] if k else -away[k])
    return _kept(replace(cable, ends=(ends[0], ends[1]), doubted=(counts[0], counts[1])), kept)


def _kept(cable: TrackedCable, kept: list[float]) -> TrackedCable:
    if kept == [0.0, cable.length_px] or kept[1] - kept[0] < _LEAST_WIDTHS * cable.width_px:
        return cable
    return replace(cut(cable, (kept[0], kept[1])), ends=cable.ends)
