"""Minimum-cost matching of section ends: every end goes on in one other end, or ends.

Symbols: n ends; link ``k`` joins two of them at a cost; ``stop`` is what it costs an end not to go
on.
"""

from __future__ import annotations

from typing import NamedTuple

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

Partners = dict[int, int]
"""Both ways; an end that stops is not in it."""


class Link(NamedTuple):
    """Two ends, what it saves against stopping at both, and the section it shares, -1 for none."""

    a: int
    b: int
    saving: float
    via: int


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
    savings = stop[pairs[:, 0]] + stop[pairs[:, 1]] - costs
    worth = savings > 0
    pairs, savings, along = pairs[worth], savings[worth], along[worth]
    if not len(pairs):
        return partner
    group = components(pairs, count)
    links: dict[int, list[Link]] = {}
    for name, (a, b), saving, section in zip(
        group[pairs[:, 0]].tolist(), pairs.tolist(), savings.tolist(), along.tolist(), strict=True
    ):
        links.setdefault(name, []).append(Link(a, b, saving, section))
    for own in links.values():
        for a, b in _match_group(own).items():
            partner[a] = b
    return partner


def greedy(count: int, pairs: IntArray, scores: FloatArray, least: float) -> IntArray:
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


def _match_group(links: list[Link]) -> Partners:
    """The partners in one group: sections become shared one by one while that saves more."""
    shared: set[int] = set()
    total, best = _matched(links, shared)
    for section in sorted({link.via for link in links if link.via >= 0})[:_MOST_SHARED]:
        more, found = _matched(links, shared | {section})
        along = [link for link in links if link.via == section]
        if more > total + _SHARED_MARGIN and _followed(found, along) > 1:
            shared, total, best = shared | {section}, more, found
    return best


def _followed(partners: Partners, along: list[Link]) -> int:
    """How many of the links along a section are taken: one DLO alone does not share it."""
    return sum(partners.get(link.a) == link.b for link in along if link.a ^ link.b != 1)


def _matched(links: list[Link], shared: set[int]) -> tuple[float, Partners]:
    """Total saving and partners when exactly these sections are shared."""
    kept = [
        link
        for link in links
        if (link.via in shared if link.via >= 0 else not {link.a >> 1, link.b >> 1} & shared)
    ]
    chosen = (
        _best(kept)
        if len({e for link in kept for e in link[:2]}) <= _EXACT_ENDS
        else _relaxed(kept)
    )
    partners = {a: b for a, b, *_ in chosen} | {b: a for a, b, *_ in chosen}
    return sum(link.saving for link in chosen), partners


def _best(links: list[Link]) -> list[Link]:
    """Disjoint links with the largest total saving: with the first end's links one by one, and
    without it."""
    if not links:
        return []
    first = links[0].a
    without = [link for link in links if first not in link[:2]]
    best = _best(without)
    worth = sum(link.saving for link in best)
    for link in links:
        if first in link[:2]:
            rest = _best([o for o in without if link.a not in o[:2] and link.b not in o[:2]])
            total = link.saving + sum(o.saving for o in rest)
            if total > worth:
                best, worth = [link, *rest], total
    return best


def _relaxed(links: list[Link]) -> list[Link]:
    """Large groups: the assignment problem on the symmetric table, whose cycles are then cut into
    pairs.

    The relaxation lets an end go on in one end and be reached from another. Even cycles of more
    than two ends split into pairs without loss; an odd cycle leaves out the end where that costs
    least.
    """
    ends = sorted({end for link in links for end in link[:2]})
    number = {end: k for k, end in enumerate(ends)}
    table = np.full((len(ends), len(ends)), np.inf)
    np.fill_diagonal(table, 0.0)
    best: dict[tuple[int, int], Link] = {}
    for link in sorted(links, key=lambda link: link.saving):
        a, b = number[link.a], number[link.b]
        table[a, b] = table[b, a] = -link.saving
        best[a, b] = best[b, a] = link
    _, following = linear_sum_assignment(table)
    chosen, seen = [], np.zeros(len(ends), dtype=bool)
    for start in range(len(ends)):
        cycle = [start]
        while not seen[start] and following[cycle[-1]] != start:
            cycle.append(int(following[cycle[-1]]))
        if not seen[start] and len(cycle) > 1:
            chosen += _pairs_of_cycle(cycle, table)
        seen[cycle] = True
    return [best[pair] for pair in chosen]


def _pairs_of_cycle(cycle: list[int], table: FloatArray) -> list[tuple[int, int]]:
    size = len(cycle)
    options = []
    for shift in range(size if size % 2 else 2):
        turned = cycle[shift:] + cycle[:shift]
        options.append(list(zip(turned[0 : size - 1 : 2], turned[1:size:2], strict=False)))
    best = min(options, key=lambda pairs: sum(table[a, b] for a, b in pairs))
    return [(a, b) for a, b in best if table[a, b] < 0]
