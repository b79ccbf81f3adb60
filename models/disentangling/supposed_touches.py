"""Joints at which a section may only touch another one: what can be planned if it does.

From a mask, a free end that comes to touch the side of a section is a branch-point. Where it closes
a ring, nothing of the ring can be turned about one place, though in truth everything can.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from models.disentangling.rigid_piece import Pivot, arms_at, body_of, heading_from
from models.topology.scene import Topology


def loosened(topology: Topology, most: int) -> Iterator[tuple[int, Topology]]:
    """Branch-points of three sections in a ring, the least certain first, each with the topology in
    which the section that goes on least smoothly only touches there and ends freely; ``most`` of
    them."""
    order = np.argsort([b.score for b in topology.branch_points], kind="stable").tolist()
    found = 0
    for branch in order:
        arms = arms_at(topology, branch)
        if found == most or len(arms) != 3:
            continue
        section, end = _touching(topology, arms)
        if _in_ring(topology, section, end):
            found += 1
            yield branch, _freed(topology, branch, section, end)


def _touching(topology: Topology, arms: list[tuple[int, int]]) -> tuple[int, int]:
    """The arm that the two smoothest ones leave over."""
    ways = [heading_from(topology, *arm, 0.0) for arm in arms]
    return arms[max(range(3), key=lambda k: -float(ways[k - 1] @ ways[k - 2]))]


def _in_ring(topology: Topology, section: int, end: int) -> bool:
    whole = topology.sections[section]
    pivot = Pivot(section, whole.length if end else 0.0, -1 if end else 1, whole.branches[end])
    return whole.branches[1 - end] >= 0 and body_of(topology, pivot) is None


def _freed(topology: Topology, branch: int, section: int, end: int) -> Topology:
    whole = topology.sections[section]
    ends, branches = list(whole.ends), list(whole.branches)
    ends[end], branches[end] = "free", -1
    sections, points = list(topology.sections), list(topology.branch_points)
    sections[section] = replace(whole, ends=(ends[0], ends[1]), branches=(branches[0], branches[1]))
    left = list(points[branch].sections)
    left.remove(section)
    points[branch] = replace(points[branch], sections=tuple(left))
    return replace(topology, sections=tuple(sections), branch_points=tuple(points))
