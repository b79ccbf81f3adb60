"""Algorithm 4 of the thesis (3.5.4): vertices with more than two edges are taken out, their
neighbors paired.

Beyond the thesis: the direction of a strand is read over several vertices before the intersection,
strands whose tangents, widths or (with a picture) colors disagree score less, strands are paired so
that the sum of their scores is largest, and the two forks that a shallow crossing leaves are one
intersection.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

import numpy as np

from models.geometry.polylines import arc_lengths
from models.instances.published.rt_dlo.arms import ARM_VERTICES, Arm, arm_of, continuation
from models.instances.published.rt_dlo.graph import Vertices
from models.strands.pairing import match
from models.strands.seen import SHARED_RADII

Graph = dict[int, set[int]]
"""Vertex to its neighbors, both ways."""


def graph_of(edges: Iterable[tuple[int, int]]) -> Graph:
    """Undirected graph of the edges; vertices without an edge are not in it."""
    graph: Graph = {}
    for a, b in edges:
        graph.setdefault(a, set()).add(b)
        graph.setdefault(b, set()).add(a)
    return graph


def chain_from(graph: Graph, start: int, at_most: int | None = None) -> list[int]:
    """Vertices from ``start`` on, in order, through a graph whose vertices have at most two
    edges."""
    chain, seen = [start], {start}
    while len(chain) != at_most and (onward := graph[chain[-1]] - seen):
        chain.append(min(onward))
        seen.add(chain[-1])
    return chain


def resolve_intersections(graph: Graph, vertices: Vertices) -> Graph:
    """The graph without ambiguous vertices: every vertex has at most two edges.

    Around each group of ambiguous vertices, the strands that enter it are paired by how well one
    continues the other, until fewer than two are left or none fits. All arms are read before the
    first pair is joined.
    """
    ambiguous = {v for v, around in graph.items() if len(around) > 2}
    solved = {v: around - ambiguous for v, around in graph.items() if v not in ambiguous}
    groups = [
        {v for v in group - ambiguous if solved[v]} for group in _merged_groups(graph, ambiguous)
    ]
    groups = _without_inner_chains(groups, solved, vertices)
    entries = [[v for v in sorted(group) if solved[v]] for group in groups]
    arms = [
        [arm_of(chain_from(solved, v, ARM_VERTICES), vertices) for v in entry] for entry in entries
    ]
    for entering in arms:
        for a, b in _paired(entering):
            solved[a].add(b)
            solved[b].add(a)
    return solved


def _merged_groups(graph: Graph, ambiguous: set[int]) -> list[set[int]]:
    """Each ambiguous vertex with its neighbors; groups that share a vertex are one (line 6)."""
    group_of: dict[int, set[int]] = {}
    for center in sorted(ambiguous):
        merged = {center} | graph[center]
        for member in sorted(merged):
            merged = merged | group_of.get(member, set())
        for member in merged:
            group_of[member] = merged
    unique = {id(group): group for group in group_of.values()}
    return list(unique.values())


def _without_inner_chains(
    groups: list[set[int]], graph: Graph, vertices: Vertices
) -> list[set[int]]:
    """Groups without the short chains inside them; what is left of a group are the vertices that
    enter it.

    A chain from a group to itself is noise around an intersection. One between two forks (groups
    that an odd number of strands enters) is the foreground that both strands of a shallow crossing
    share: the forks become one group. Both kinds of chain lose their edges in ``graph``.
    """
    groups = [set(group) for group in groups]
    home = {v: index for index, group in enumerate(groups) for v in group}
    for vertex in sorted(home):
        mine, chain = home[vertex], chain_from(graph, vertex)
        other = home.get(chain[-1]) if len(chain) > 1 else None
        if other is None or not _is_short(chain, vertices):
            continue
        if other != mine and (len(groups[mine]) % 2 == 0 or len(groups[other]) % 2 == 0):
            continue
        for member in chain:
            graph[member] = set()
        groups[mine] = (groups[mine] | groups[other]) - {chain[0], chain[-1]}
        if other != mine:
            groups[other] = set()
            home.update(dict.fromkeys(groups[mine], mine))
    return [group for group in groups if group]


def _is_short(chain: list[int], vertices: Vertices) -> bool:
    length = float(arc_lengths(vertices.xy[chain])[-1])
    return length <= SHARED_RADII * vertices.typical_radius


def _paired(arms: list[Arm]) -> list[tuple[int, int]]:
    """Disjoint pairs with the largest sum of scores (lines 9 to 19)."""
    scored = [(a, b, continuation(arms[a], arms[b])) for a, b in combinations(range(len(arms)), 2)]
    able = [row for row in scored if row[2] > 0]
    pairs = np.array([row[:2] for row in able], dtype=np.int64).reshape(-1, 2)
    partner = match(
        len(arms), pairs, np.array([-score for _, _, score in able]), np.zeros(len(arms))
    )
    return [(arms[k].vertex, arms[p].vertex) for k, p in enumerate(partner.tolist()) if k < p]
