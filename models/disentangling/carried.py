"""What an earlier picture showed, carried over an action to the next one.

A harness that is moved on a table keeps its sections, branch-points and ends: what a new picture
shows unclearly, or not at all as it lies out of view, is known from the one before.

Strategy: the piece that the action turned is brought where the new picture shows it. Where all that
either topology shows is explained by the other then, they can only differ in what a joint is: the
one that is surer of that counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from models.disentangling.hands import in_hands, usual_hand_px
from models.disentangling.moved_piece import (
    NEAR,
    STEP,
    View,
    dense,
    joined,
    movement_of,
    points_of,
    with_line,
)
from models.disentangling.result_of_turn import after_move
from models.disentangling.rigid_piece import Pivot, body_of
from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.components import runs
from models.geometry.polylines import arc_lengths
from models.topology.scene import BranchPoint, Crossing, EndKind, Place, Topology

_LONGEST = 2.5
"""Hands of a line that may be missing in the other topology: an end that is cut off, a clip."""
_BORDER = 1.0
"""Hands from the picture's border within which nothing need be seen."""
_TAKES, _PICKS = 1.5, 1.0
"""Hands from a branch-point within which a gripper may have taken it, and from a strand within
which it was picked."""
_SAME, _BESIDE = 2.5, 5.0
"""Hands between two readings of one place; between a crossing and the branch-points that it may be
read as."""
_SURE = 0.98
"""A reading counts for no more than this probability."""
_FORESEEN = 0.9
"""Probability of a crossing that the movement makes and no picture has shown yet."""


@dataclass(frozen=True)
class Done:
    """An action that was carried out: held and picked where, px; turned by how much, radians."""

    hold: tuple[float, float]
    pick: tuple[float, float]
    turn: float


def readings(before: Topology, done: Done, seen: Topology) -> list[Topology]:
    """What to plan on after an action, the best first: the topology ``before`` as the action left
    it, where ``seen``, read from the picture after it, agrees; then ``seen``."""
    known = carried(before, done, seen)
    return [seen] if known is None else [known, seen]


def carried(before: Topology, done: Done, seen: Topology) -> Topology | None:
    """The topology ``before`` after an action; None where the picture after it shows something
    else, or is surer of what it shows."""
    if not before.sections or not seen.sections:
        return None
    hand_px = usual_hand_px(before)
    shown = in_hands(seen, hand_px)
    view = View(seen.size[1] / hand_px, seen.size[0] / hand_px)
    expected = list(_expected(in_hands(before, hand_px), done, hand_px, shown, view))
    missing = [_disagreement(e, shown, view) for e in expected]
    k = int(np.argmin(missing))
    ours, theirs = (_sureness(*pair, view) for pair in ((expected[k], shown), (shown, expected[k])))
    if missing[k] > _LONGEST or theirs > ours:
        return None
    known = _compared(expected[k], shown, 1 - max(theirs, 0.0) / max(ours, 1e-9), view)
    return replace(
        seen,
        status="branched" if known.branch_points else "plain",
        **{
            name: getattr(in_hands(known, 1 / hand_px), name)
            for name in ("sections", "branch_points", "crossings")
        },
    )


def _expected(
    scene: Topology, done: Done, hand_px: float, shown: Topology, view: View
) -> Iterator[Topology]:
    """The topology in hands if nothing moved, and if a piece did that may have been taken."""
    yield scene
    hold, pick = (np.array(p) / hand_px for p in (done.hold, done.pick))
    for pivot in _pivots(scene, hold):
        body = body_of(scene, pivot)
        picked = body is not None and any(
            len(xy) and np.hypot(*(xy - pick).T).min() < _PICKS for _, xy in body.moving
        )
        move = movement_of(body, done.turn, shown, view) if body is not None and picked else None
        if body is not None and move is not None:
            after = joined(after_move(scene, pivot, body, move, _FORESEEN), pivot, move)
            yield _entered(after, shown, view)


def _pivots(scene: Topology, hold: FloatArray) -> list[Pivot]:
    """What a gripper may hold: a branch-point near it, or the section, for the piece on either
    side."""
    found = []
    for b, point in enumerate(scene.branch_points):
        if np.hypot(*(np.array(point.xy) - hold)) < _TAKES:
            found += [
                Pivot(k, scene.sections[k].length if end else 0.0, -1 if end else 1, b)
                for k in sorted(set(point.sections))
                for end in (0, 1)
                if scene.sections[k].branches[end] == b
            ]
    k = int(np.argmin([np.hypot(*(s.xy - hold).T).min() for s in scene.sections]))
    line = scene.sections[k].xy
    at = float(arc_lengths(line)[np.hypot(*(line - hold).T).argmin()])
    return found + [Pivot(k, at, side, -1) for side in (1, -1)]


def _disagreement(expected: Topology, shown: Topology, view: View) -> float:
    """Hands of the longest stretch in view that one topology has and the other has not."""
    longest = 0
    for ours, theirs in ((expected, shown), (shown, expected)):
        tree = cKDTree(points_of([s.xy for s in theirs.sections]))
        for section in ours.sections:
            line = dense(section.xy)
            lost = (tree.query(line)[0] > NEAR) & view.shows(line, _BORDER)
            longest = max([longest, *(stop - start for start, stop in runs(lost))])
    return longest * STEP


def _sureness(ours: Topology, theirs: Topology, view: View) -> float:
    """Log odds of what one topology reads in view and the other does not; of a branch-point only
    where the other one has a crossing instead: strands that only touch join nothing."""
    total = 0.0
    for mine, others in _kinds(ours, theirs):
        instead = theirs.crossings if mine is ours.branch_points else ()
        for point, alone in zip(mine, _alone(mine, others, view), strict=True):
            read = mine is not ours.branch_points or _away(point, instead) < _BESIDE
            total += _log_odds(point.score) if alone and read else 0.0
    return total


def _away(point: BranchPoint | Crossing, others: Sites) -> float:
    """Hands to the nearest of others."""
    return min((float(np.hypot(*np.subtract(point.xy, o.xy))) for o in others), default=np.inf)


def _compared(known: Topology, shown: Topology, share: float, view: View) -> Topology:
    """The topology with the higher score where both read the same, and with so much of the log odds
    left where the other one reads something else."""

    def scored(mine: Sites, others: Sites) -> Iterator[float]:
        for point, alone in zip(mine, _alone(mine, others, view), strict=True):
            near = [o.score for o in others if np.hypot(*np.subtract(o.xy, point.xy)) < _SAME]
            doubted = 1 / (1 + float(np.exp(-share * _log_odds(point.score))))
            yield doubted if alone else max([point.score, *near])

    branches, crossings = (scored(*pair) for pair in _kinds(known, shown))
    return replace(
        known,
        branch_points=tuple(
            replace(p, score=s) for p, s in zip(known.branch_points, branches, strict=True)
        ),
        crossings=tuple(
            replace(c, score=s) for c, s in zip(known.crossings, crossings, strict=True)
        ),
    )


Sites = Sequence[BranchPoint | Crossing]


def _kinds(ours: Topology, theirs: Topology) -> tuple[tuple[Sites, Sites], tuple[Sites, Sites]]:
    return (
        (ours.branch_points, theirs.branch_points),
        (ours.crossings, theirs.crossings),
    )


def _alone(mine: Sites, others: Sites, view: View) -> BoolArray:
    """``(n,)`` what is in view and has nothing of its kind near it in the other topology."""
    here, there = (np.array([p.xy for p in sites]).reshape(-1, 2) for sites in (mine, others))
    away = np.hypot(*np.moveaxis(here[:, None] - there, -1, 0))
    return np.asarray(view.shows(here, _BORDER) & ~(away < _SAME).any(axis=1))


def _log_odds(score: float) -> float:
    bounded = min(max(score, 1 - _SURE), _SURE)
    return float(np.log(bounded / (1 - bounded)))


def _entered(expected: Topology, shown: Topology, view: View) -> Topology:
    """The topology with what has come into view of sections that left the picture before."""
    for k, section in enumerate(expected.sections):
        for end in (0, 1):
            last = section.xy[-1 if end else 0]
            if section.ends[end] == "border" and view.shows(last, NEAR):
                expected = _longer(expected, k, end, shown)
    return expected


def _longer(expected: Topology, k: int, end: int, shown: Topology) -> Topology:
    """The topology with what is shown beyond an end of a section; without it where that branches or
    crosses something, for nobody knows then what it is."""
    section = expected.sections[k]
    line = section.xy if end else section.xy[::-1]
    found = _beyond(line, shown)
    if found is None:
        return expected
    beyond, kind = found
    xy = np.concatenate([line, beyond])
    ends = (section.ends[0], kind) if end else (kind, section.ends[1])
    longer = with_line(replace(section, ends=ends), xy if end else xy[::-1])
    share = section.length / longer.length

    def place(p: Place) -> Place:
        return p if p.section != k else Place(k, p.u * share + (0.0 if end else 1 - share))

    return replace(
        expected,
        sections=(*expected.sections[:k], longer, *expected.sections[k + 1 :]),
        crossings=tuple(
            replace(c, over=place(c.over), under=place(c.under)) for c in expected.crossings
        ),
    )


def _beyond(line: FloatArray, shown: Topology) -> tuple[FloatArray, EndKind] | None:
    """What is shown beyond the last point of a polyline, and how it ends."""
    last, heading = line[-1], line[-1] - line[max(-5, -len(line))]
    away = [float(np.hypot(*(s.xy - last).T).min()) for s in shown.sections]
    m = int(np.argmin(away))
    other = shown.sections[m]
    n = int(np.hypot(*(other.xy - last).T).argmin())
    onward = bool((other.xy[min(n + 3, len(other.xy) - 1)] - other.xy[max(n - 3, 0)]) @ heading > 0)
    beyond = other.xy[n + 1 :] if onward else other.xy[:n][::-1]
    here = float(arc_lengths(other.xy)[n]) / max(other.length, STEP)
    crossed = any(
        (p.u > here) == onward for c in shown.crossings for p in (c.over, c.under) if p.section == m
    )
    kind = other.ends[1 if onward else 0]
    if away[m] > NEAR or not len(beyond) or crossed or kind == "branch":
        return None
    return beyond, kind
