"""Minimum-cost matching of section ends: every end goes on in one other end, or ends.

Symbols: n ends; link ``k`` joins two of them at a cost; ``stop`` is what it costs an end not to go on.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from models.geometry.arrays import FloatArray, IntArray

_EXACT_ENDS = 8
"""Groups of up to so many ends are solved by comparing every matching."""
_FORBIDDEN = 1e6


def match(count: int, pairs: IntArray, costs: FloatArray, stop: FloatArray) -> IntArray:
    """``(n,)`` the partner of every end, itself for an end that stops.

    ``pairs``: ``(m, 2)`` possible links, ``costs``: ``(m,)``, ``stop``: ``(n,)``. The total of the costs of all
    links taken and of all stops is smallest over each connected group of ends, not chosen link by link.
    """
    partner = np.arange(count)
    worth = costs < stop[pairs[:, 0]] + stop[pairs[:, 1]]
    pairs, costs = pairs[worth], costs[worth]
    if not len(pairs):
        return partner
    table = csr_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), (count, count))
    _, group = connected_components(table, directed=False)
    order = np.argsort(group[pairs[:, 0]], kind="stable")
    starts = np.flatnonzero(np.diff(group[pairs[order, 0]], prepend=-1))
    for rows in np.split(order, starts[1:]):
        members, local = np.unique(pairs[rows], return_inverse=True)
        found = _solve(local.reshape(-1, 2), costs[rows], stop[members])
        partner[members] = members[found]
    return partner


def _solve(pairs: IntArray, costs: FloatArray, stop: FloatArray) -> IntArray:
    """Partners within one group, ends numbered from 0. Costs become savings against stopping at both ends."""
    savings = stop[pairs[:, 0]] + stop[pairs[:, 1]] - costs
    if len(savings) == 1:
        return np.array([1, 0])
    if len(stop) <= _EXACT_ENDS:
        chosen = _best(tuple((int(a), int(b), float(s)) for (a, b), s in zip(pairs, savings, strict=True)))[1]
    else:
        chosen = _relaxed(pairs, savings, len(stop))
    partner = np.arange(len(stop))
    for a, b in chosen:
        partner[a], partner[b] = b, a
    return partner


Link = tuple[int, int, float]


def _best(links: tuple[Link, ...]) -> tuple[float, list[tuple[int, int]]]:
    """Largest total saving of disjoint links: with the first end's links one by one, and without it."""
    if not links:
        return 0.0, []
    first = links[0][0]
    without = tuple(link for link in links if first not in link[:2])
    best = _best(without)
    for a, b, saving in links:
        if first in (a, b):
            total, chosen = _best(tuple(link for link in without if b not in link[:2] and a not in link[:2]))
            if total + saving > best[0]:
                best = total + saving, [(a, b), *chosen]
    return best


def _relaxed(pairs: IntArray, savings: FloatArray, count: int) -> list[tuple[int, int]]:
    """Large groups: the assignment problem on the symmetric table, whose cycles are then cut into pairs.

    The relaxation lets an end go on in one end and be reached from another. Even cycles of more than two ends
    split into pairs without loss; an odd cycle leaves out the end where that costs least.
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
