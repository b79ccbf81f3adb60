"""The graph of the strands in a mask: joints, free ends and the medial lines between them, and how
it is cleaned: what only the outline's unevenness makes is taken out (before thesis 6.4.2)."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray
from models.geometry.polylines import arc_lengths
from models.geometry.sampling import read_nearest
from models.strands.pixel_graph import PixelGraph, smoothed


@dataclass(frozen=True, eq=False)
class Strand:
    """A medial line between two knots (``a`` at its first, ``b`` at its last point; equal for a
    ring).

    ``xy``: ``(n, 2)`` about a pixel apart; ``radii``: ``(n,)`` distance to the background.
    """

    a: int
    b: int
    xy: FloatArray
    radii: FloatArray

    @cached_property
    def length(self) -> float:
        return float(arc_lengths(self.xy)[-1])

    def reversed(self) -> Strand:
        return Strand(self.b, self.a, self.xy[::-1], self.radii[::-1])

    def followed_by(self, other: Strand) -> Strand:
        """One strand of two, of which the second starts where the first ends."""
        xy, radii = (
            np.concatenate((self.xy, other.xy[1:])),
            np.concatenate((self.radii, other.radii[1:])),
        )
        return Strand(self.a, other.b, xy, radii)

    def seen_from(self, knot: int) -> Strand:
        """The strand with ``knot`` at its first point."""
        return self if self.a == knot else self.reversed()


@dataclass(frozen=True, eq=False)
class Web:
    """``knots_xy``: ``(K, 2)`` joints and free ends; the strands between them."""

    knots_xy: FloatArray
    strands: tuple[Strand, ...]


def web_of(graph: PixelGraph, distances: Float32Array) -> Web:
    """The strands of a pixel graph, as it shows them: nothing is left out yet.

    Strategy: the joints at its ends are put before and after each chain's pixels; all lines are
    then smoothed and their radii read at once.
    """
    count = len(graph.closed)
    ends = graph.ends.copy()
    first, last = graph.bounds[:-1], graph.bounds[1:] - 1
    ends[graph.closed] = -1
    loose = ends < 0
    loose[graph.closed, 1] = False
    ends[loose] = len(graph.junction_xy) + np.arange(np.count_nonzero(loose))
    ends[graph.closed, 1] = ends[graph.closed, 0]
    tips = graph.xy[np.stack((first, last), axis=1)[loose]].reshape(-1, 2)
    knots = np.concatenate((graph.junction_xy, tips)).astype(np.float64)
    bounds = graph.bounds + 2 * np.arange(count + 1)
    line = np.empty((int(bounds[-1]), 2))
    line[np.arange(len(graph.xy)) + 2 * np.repeat(np.arange(count), np.diff(graph.bounds)) + 1] = (
        graph.xy
    )
    line[bounds[:-1]], line[bounds[1:] - 1] = knots[ends[:, 0]], knots[ends[:, 1]]
    radii, xy = read_nearest(distances, line), smoothed(line, bounds)
    strands = (
        Strand(a, b, xy[start:stop], radii[start:stop])
        for (a, b), start, stop in zip(
            ends.tolist(), bounds[:-1].tolist(), bounds[1:].tolist(), strict=True
        )
    )
    return Web(knots, tuple(s for s in strands if s.a != s.b or not _is_curl(s)))


def cleaned(web: Web) -> Web:
    """The web without spurs and specks; joints that belong together are one, knots on a strand are
    dissolved."""
    web = contract(dissolve(web))
    for _ in range(3):
        count = degrees(web)
        kept = tuple(s for s in web.strands if not _is_spur(s, count))
        if len(kept) == len(web.strands):
            break
        web = contract(dissolve(Web(web.knots_xy, kept)))
    count = degrees(web)
    return compact(Web(web.knots_xy, tuple(s for s in web.strands if not _is_speck(s, count))))


def degrees(web: Web) -> dict[int, int]:
    """How many strands end at each knot; a ring counts twice."""
    count: dict[int, int] = defaultdict(int)
    for strand in web.strands:
        count[strand.a] += 1
        count[strand.b] += 1
    return count


def protrusion(strand: Strand, joint: int) -> float:
    """How far a strand reaches beyond the disc of the joint that it leaves, px."""
    seen = strand.seen_from(joint)
    return seen.length + float(seen.radii[-1]) - float(seen.radii[0])


def _is_spur(strand: Strand, count: dict[int, int]) -> bool:
    """A free end that reaches less than a radius beyond the joint's disc is no branch."""
    for joint, tip in ((strand.a, strand.b), (strand.b, strand.a)):
        if count[tip] == 1 and count[joint] > 2:
            return strand.length < 2 * strand.seen_from(joint).radii[0]
    return False


def _is_speck(strand: Strand, count: dict[int, int]) -> bool:
    """Alone, and hardly longer than wide."""
    if strand.a == strand.b or count[strand.a] != 1 or count[strand.b] != 1:
        return False
    return strand.length < 2 * float(strand.radii.max())


def dissolve(web: Web) -> Web:
    """Strands that meet two by two become one."""
    at: dict[int, list[Strand]] = defaultdict(list)
    for strand in web.strands:
        at[strand.a].append(strand)
        if strand.b != strand.a:
            at[strand.b].append(strand)
    for knot in list(at):
        pair = at[knot]
        if len(pair) != 2 or any(s.a == s.b for s in pair):
            continue
        first, second = pair[0].seen_from(knot).reversed(), pair[1].seen_from(knot)
        joined = first.followed_by(second)
        del at[knot]
        for end in {first.a, second.b}:
            at[end] = [s for s in at[end] if s is not pair[0] and s is not pair[1]] + [joined]
    kept = {id(s): s for strands in at.values() for s in strands}
    return Web(web.knots_xy, tuple(kept.values()))


def contract(web: Web) -> Web:
    """Joints that lie within each other's disc become one, at their middle."""
    count = degrees(web)
    parent = np.arange(len(web.knots_xy))

    def root(k: int) -> int:
        while parent[k] != k:
            k = int(parent[k])
        return k

    for s in web.strands:
        near = s.length <= max(s.radii[0], s.radii[-1])
        if near and count[s.a] > 2 and count[s.b] > 2 and s.a != s.b:
            parent[root(s.a)] = root(s.b)
    roots = np.array([root(k) for k in range(len(parent))], dtype=np.int64)
    if np.array_equal(roots, np.arange(len(roots))):
        return web
    sizes = np.bincount(roots, minlength=len(roots))
    sums = np.stack(
        [np.bincount(roots, web.knots_xy[:, axis], len(roots)) for axis in (0, 1)], axis=1
    )
    middle: FloatArray = sums / np.maximum(sizes, 1.0)[:, None]
    moved = (_moved(s, int(roots[s.a]), int(roots[s.b]), middle) for s in web.strands)
    kept = tuple(s for s in moved if s.a != s.b or not _is_curl(s))
    return Web(middle, kept)


def _is_curl(strand: Strand) -> bool:
    """A ring around no hole: its radius is not above half its width."""
    return strand.length <= 2 * np.pi * float(strand.radii.max())


def _moved(strand: Strand, a: int, b: int, knots: FloatArray) -> Strand:
    xy = strand.xy.copy()
    xy[0], xy[-1] = knots[a], knots[b]
    return Strand(a, b, xy, strand.radii)


def compact(web: Web) -> Web:
    """The web with only the knots that strands end at, numbered anew."""
    used = sorted({k for s in web.strands for k in (s.a, s.b)})
    new = {old: k for k, old in enumerate(used)}
    strands = tuple(Strand(new[s.a], new[s.b], s.xy, s.radii) for s in web.strands)
    return Web(web.knots_xy[used].reshape(-1, 2), strands)
