"""Minimum-cost matching of section ends: every end goes on in one other end, or ends.

Symbols: n ends; link ``k`` joins two of them at a cost; ``stop`` is what it costs an end not to go
on.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from models.geometry.arrays import FloatArray, IntArray
from models.geometry.components import components

_EXACT_ENDS = 8
"""Groups of up to so many ends are solved by comparing every matching."""
_MOST_SHARED = 12
"""So many sections of a group are tried as shared."""
_SHARED_MARGIN = -1.5
"""Log odds by which sharing may be worse: not to share leaves strands that end in the middle of
nowhere."""
_FORBIDDEN = 1e6
"""Cost of a pair that is no link: larger than any sum of costs."""


def match(
    count: int, pairs: IntArray, costs: FloatArray, stop: FloatArray, via: IntArray | None = None
) -> IntArray:
    """``(n,)`` the partner of every end, itself for an end that stops.

    ``pairs``: ``(m, 2)`` possible links, ``costs``: ``(m,)``, ``stop``: ``(n,)``. The total of the
    costs of all links taken and of all stops is smallest over each connected group of ends, not
    chosen link by link. ``via``: ``(m,)`` the section that a link shares, -1 for none: a section is
    either shared, and then its own two ends (``2 s`` and ``2 s + 1``) go on nowhere else, or it is
    not, and no link leads along it.
    """
    partner = np.arange(count)
    along = np.full(len(pairs), -1) if via is None else via
    worth = costs < stop[pairs[:, 0]] + stop[pairs[:, 1]]
    pairs, costs, along = pairs[worth], costs[worth], along[worth]
    if not len(pairs):
        return partner
    group = components(pairs, count)
    order = np.argsort(group[pairs[:, 0]], kind="stable")
    starts = np.flatnonzero(np.diff(group[pairs[order, 0]], prepend=-1))
    for rows in np.split(order, starts[1:]):
        _match_group(pairs[rows], costs[rows], stop, along[rows], partner)
    return partner


def greedy(count: int, pairs: IntArray, scores: FloatArray, least: float = -np.inf) -> IntArray:
    """``(n,)`` the partner of every end, itself where it has none: best of ``(m, 2)`` pairs first,
    each end once.

    ``scores``: ``(m,)``; pairs that are not above ``least`` are left out.
    """
    partner = np.arange(count)
    for k in np.argsort(-scores, kind="stable").tolist():
        a, b = pairs[k].tolist()
        if scores[k] > least and partner[a] == a and partner[b] == b:
            partner[a], partner[b] = b, a
    return partner


def _match_group(
    pairs: IntArray, costs: FloatArray, stop: FloatArray, via: IntArray, partner: IntArray
) -> None:
    """Fill in the partners of one group: sections become shared one by one while that lowers the
    total."""
    shared: set[int] = set()
    total, best = _matched(pairs, costs, stop, via, shared)
    for section in np.unique(via[via >= 0]).tolist()[:_MOST_SHARED]:
        lower, found = _matched(pairs, costs, stop, via, shared | {section})
        if lower < total - _SHARED_MARGIN and _followed(found, pairs[via == section]) > 1:
            shared, total, best = shared | {section}, lower, found
    for a, b in best.items():
        partner[a] = b


def _followed(partners: dict[int, int], along: IntArray) -> int:
    """How many of the links along a section are taken: one DLO alone does not share it."""
    return sum(partners.get(a) == b for a, b in along.tolist() if a ^ b != 1)


def _matched(
    pairs: IntArray, costs: FloatArray, stop: FloatArray, via: IntArray, shared: set[int]
) -> tuple[float, dict[int, int]]:
    """Total (against all ends stopping) and partners when exactly these sections are shared."""
    kept = via < 0
    if shared:
        kept &= ~np.isin(pairs >> 1, list(shared)).any(axis=1)
        kept |= np.isin(via, list(shared))
    pairs, costs = pairs[kept], costs[kept]
    if not len(pairs):
        return 0.0, {}
    members, local = np.unique(pairs, return_inverse=True)
    found = _solve(local.reshape(-1, 2), costs, stop[members])
    best = {int(members[k]): int(members[p]) for k, p in enumerate(found.tolist()) if p != k}
    # Of several links between the same two ends the cheapest, written last, counts.
    dearest_first = np.argsort(-costs, kind="stable")
    cost = {
        (a, b): c
        for (a, b), c in zip(
            pairs[dearest_first].tolist(), costs[dearest_first].tolist(), strict=True
        )
    }
    return sum(cost[a, b] - float(stop[a] + stop[b]) for a, b in best.items() if a < b), best


def _solve(pairs: IntArray, costs: FloatArray, stop: FloatArray) -> IntArray:
    """Partners within one group, ends numbered from 0. Costs become savings against stopping at
    both ends."""
    savings = stop[pairs[:, 0]] + stop[pairs[:, 1]] - costs
    if len(savings) == 1:
        return np.array([1, 0])
    if len(stop) <= _EXACT_ENDS:
        chosen = _best(
            tuple((int(a), int(b), float(s)) for (a, b), s in zip(pairs, savings, strict=True))
        )[1]
    else:
        chosen = _relaxed(pairs, savings, len(stop))
    partner = np.arange(len(stop))
    for a, b in chosen:
        partner[a], partner[b] = b, a
    return partner


Link = tuple[int, int, float]


def _best(links: tuple[Link, ...]) -> tuple[float, list[tuple[int, int]]]:
    """Largest total saving of disjoint links: with the first end's links one by one, and without
    it."""
    if not links:
        return 0.0, []
    first = links[0][0]
    without = tuple(link for link in links if first not in link[:2])
    best = _best(without)
    for a, b, saving in links:
        if first in (a, b):
            total, chosen = _best(
                tuple(link for link in without if b not in link[:2] and a not in link[:2])
            )
            if total + saving > best[0]:
                best = total + saving, [(a, b), *chosen]
    return best


def _relaxed(pairs: IntArray, savings: FloatArray, count: int) -> list[tuple[int, int]]:
    """Large groups: the assignment problem on the symmetric table, whose cycles are then cut into
    pairs.

    The relaxation lets an end go on in one end and be reached from another. Even cycles of more
    than two ends split into pairs without loss; an odd cycle leaves out the end where that costs
    least.
    """
    table = np.full((count, count), _FORBIDDEN)
    np.fill_diagonal(table, 0.0)
    table[pairs[:, 0], pairs[:, 1]] = table[pairs[:, 1], pairs[:, 0]] = -savings
    _, following = linear_sum_assignment(table)
    chosen, seen = [], np.zeros(count, dtype=bool)
    for start in range(count):
        cycle = [start]
        while not seen[start] and following[cycle[-1]] != start:
            cycle.append(int(following[cycle[-1]]))
        if not seen[start] and len(cycle) > 1:
            chosen += _pairs_of_cycle(cycle, table)
        seen[cycle] = True
    return chosen


def _pairs_of_cycle(cycle: list[int], table: FloatArray) -> list[tuple[int, int]]:
    size = len(cycle)
    options = []
    for shift in range(size if size % 2 else 2):
        turned = cycle[shift:] + cycle[:shift]
        options.append(list(zip(turned[0 : size - 1 : 2], turned[1:size:2], strict=False)))
    best = min(options, key=lambda pairs: sum(table[a, b] for a, b in pairs))
    return [(a, b) for a, b in best if table[a, b] < 0]
