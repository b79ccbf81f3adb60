"""The topology as a turn would leave it, the piece being rigid (thesis 6.7)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from models.disentangling.hold_candidates import moves_with
from models.disentangling.rigid_piece import Body, Pivot, as_pair, turned
from models.disentangling.sweep import Sweep
from models.disentangling.turn_candidates import Turn
from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths
from models.topology.scene import BranchPoint, Crossing, Place, Section, Topology


def after_turn(topology: Topology, turn: Turn) -> Topology:
    """The same sections, some of them elsewhere."""
    body = turn.held.body
    return after_move(
        topology, turn.held.pivot, body, lambda xy: turned(xy, body.center, turn.angle)
    )


def after_move(
    topology: Topology,
    pivot: Pivot,
    body: Body,
    moved: Callable[[FloatArray], FloatArray],
    score: float = 1.0,
) -> Topology:
    """The same sections, those of a piece where ``moved`` brings their points. Crossings within the
    piece and within the rest stay as they are; where the piece is now over something (``score``: how
    probably it is), it is on top for sure."""
    beyond = {k for k, _ in body.moving} - {pivot.section}
    far = topology.sections[pivot.section].branches[1 if pivot.side > 0 else 0]
    branches = {b for k in beyond for b in topology.sections[k].branches} | {far}

    def section(k: int, line: Section) -> Section:
        if k == pivot.section:
            turns = (arc_lengths(line.xy) - pivot.at) * pivot.side > 0
            return replace(line, xy=np.where(turns[:, None], moved(line.xy), line.xy))
        return replace(line, xy=moved(line.xy)) if k in beyond else line

    def branch(k: int, point: BranchPoint) -> BranchPoint:
        away = k in branches and k != pivot.branch
        return replace(point, xy=as_pair(moved(np.array(point.xy)))) if away else point

    sections = tuple(section(k, s) for k, s in enumerate(topology.sections))
    kept = []
    for crossing in topology.crossings:
        over, under = (
            moves_with(topology, p, body, pivot) for p in (crossing.over, crossing.under)
        )
        if over == under:
            kept.append(
                replace(crossing, xy=as_pair(moved(np.array(crossing.xy)))) if over else crossing
            )
    there = replace(body, moving=tuple((k, moved(xy)) for k, xy in body.moving))
    new = [
        Crossing(as_pair(xy), _place(sections, k, xy), _place(sections, rest, xy), score, 1.0)
        for k, rest, xy in Sweep(topology, there).crossings(0.0)
    ]
    points = tuple(branch(k, p) for k, p in enumerate(topology.branch_points))
    return replace(topology, sections=sections, branch_points=points, crossings=(*kept, *new))


def _place(sections: tuple[Section, ...], k: int, xy: FloatArray) -> Place:
    lengths = arc_lengths(sections[k].xy)
    nearest = int(np.hypot(*(sections[k].xy - xy).T).argmin())
    return Place(k, float(lengths[nearest] / lengths[-1]))
