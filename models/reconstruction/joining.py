"""Which pieces of strands are one DLO: decided again from all views, where one picture leaves it
open.

The instance methods join strands in one picture. Where DLOs of one color cross at a low angle or
lie side by side that is a guess, and the same guess in every view. Strategy: every strand is cut
where its two edges are not both seen (``Strand.known``): another DLO crosses or touches it there.
The pieces are matched against the other views one by one, so that each has a depth of its own. A
join of two ends costs what the curve that bridges them bends, how far their depths are apart, how
long it is and how much of it runs beside the foreground. Of all ways to join the ends of a view the
cheapest is taken; a join is left out where another way is nearly as cheap: the DLO then ends there,
which is better than going on as another one.

Costs are in squared standard deviations. Symbols as in ``piece_ends``.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.geometry.components import components, runs
from models.geometry.polylines import bridge
from models.reconstruction.matching import MatchParams
from models.reconstruction.piece_ends import PieceEnds, piece_ends
from models.reconstruction.views import Strand, View
from models.strands.pairing import match
from models.strands.walks import follow


@dataclass(frozen=True)
class JoinParams:
    """``shortest_px`` of a piece; ``trim_px`` of it are cut off where another DLO begins to disturb
    it.

    ``turn`` (radians): what directions are off by; ``bend`` (radians a pixel): how much DLOs bend;
    ``rise``: how much their slope changes, pixels of disparity a pixel; ``depth_at_most``: a depth
    may have been matched wrongly; ``steepest_turn`` (radians) of an end against the chord;
    ``far_widths``: a gap so wide costs 1; ``beside``: cost of a bridge that is beside the
    foreground; ``kept``: what is taken off for a join that the instance method made too.
    ``dearest``: join that is made; ``margin``: by which any other way must be dearer.
    ``gap_widths``: longest gap; up to ``short_widths`` the bridge counts as seen.
    """

    shortest_px: int = 26
    trim_px: int = 3
    turn: float = 0.08
    bend: float = 0.003
    rise: float = 0.02
    depth_at_most: float = 6.0
    far_widths: float = 5.5
    beside: float = 20.0
    kept: float = 0.5
    dearest: float = 3.0
    margin: float = 1.0
    gap_widths: float = 22.0
    short_widths: float = 2.8
    steepest_turn: float = 1.0
    matching: MatchParams = field(default_factory=MatchParams)


@dataclass(frozen=True, eq=False)
class Rejoined:
    """``view`` with its new strands; ``share_px`` (new, old) how many pixels of each old strand are
    in each new one."""

    view: View
    share_px: FloatArray


def rejoin(views: list[View]) -> list[Rejoined]:
    """The views with strands that all of them agree on; a view without any doubtful stretch stays
    as it is."""
    settings = JoinParams()
    cut = [_pieces(view, settings) for view in views]
    return [_rejoined(k, cut, views[k], settings) for k in range(len(views))]


@dataclass(frozen=True, eq=False)
class _Pieces:
    """``view`` with pieces as strands; ``origin`` (P,) the strand that each was cut from, in order
    along it."""

    view: View
    origin: IntArray


def _pieces(view: View, params: JoinParams) -> _Pieces:
    pieces, origin = [], []
    for number, strand in enumerate(view.strands):
        found = _pieces_of(strand, params)
        pieces += found
        origin += [number] * len(found)
    return _Pieces(replace(view, strands=tuple(pieces)), np.array(origin, np.int64))


def _pieces_of(strand: Strand, params: JoinParams) -> list[Strand]:
    """The known stretches that are long enough; the strand itself if none is."""
    if strand.known.all():
        return [strand]
    found = []
    for first, past in runs(strand.known):
        if past - first >= params.shortest_px:
            begin = first + params.trim_px * (first > 0)
            found.append(strand.part(begin, past - params.trim_px * (past < len(strand.xy))))
    return found or [strand]


def _rejoined(number: int, cut: list[_Pieces], whole: View, params: JoinParams) -> Rejoined:
    own = cut[number]
    if len(own.view.strands) == len(whole.strands) and all(s.known.all() for s in whole.strands):
        return Rejoined(whole, np.diag([s.length_px for s in whole.strands]))
    others = [p.view for k, p in enumerate(cut) if k != number and p.view.strands]
    ends = piece_ends(own.view, others, params.matching)
    width = float(np.median(np.concatenate([s.width_px for s in own.view.strands])))
    cost = join_costs(ends, own.origin, width, params)
    cost += _beside(ends, cost < params.dearest, whole, width, params)
    return _joined(own, ends, partners(cost, params), width, len(whole.strands), params)


def join_costs(
    ends: PieceEnds, origin: IntArray, width_px: float, params: JoinParams
) -> FloatArray:
    """(E, E) cost of joining two ends, infinite where they do not face each other.

    A bridge of length L that leaves at an angle a to the chord and arrives at b has the bending
    energy (4 / L) (a² + a b + b²) of a cubic beam; an arc has b = -a.
    """
    chord = ends.tip[None] - ends.tip[:, None]
    gap = np.hypot(chord[..., 0], chord[..., 1])
    leaving = _angle(chord, np.broadcast_to(ends.outward[:, None], chord.shape))
    arriving = _angle(chord, np.broadcast_to(-ends.outward[None], chord.shape))
    bent = leaving**2 + leaving * arriving + arriving**2
    cost = bent / (params.turn**2 + (params.bend * gap) ** 2) + gap / (params.far_widths * width_px)
    cost += _depth_cost(ends, gap, params) - params.kept * _cut_apart(origin)
    piece = np.arange(len(gap)) // 2
    cost[(gap > params.gap_widths * width_px) | (piece[:, None] == piece[None])] = np.inf
    cost[np.maximum(np.abs(leaving), np.abs(arriving)) > params.steepest_turn] = np.inf
    return cost


def _depth_cost(ends: PieceEnds, gap: FloatArray, params: JoinParams) -> FloatArray:
    """(E, E): both disparities are carried on to the middle of the gap."""
    there = ends.disparity[:, None] + ends.slope[:, None] * gap / 2
    own = ends.sigma[:, None] ** 2 + (ends.slope_sigma[:, None] * gap / 2) ** 2
    variance = own + own.T + (params.rise * gap) ** 2
    cost: FloatArray = np.minimum((there - there.T) ** 2 / variance, params.depth_at_most)
    return cost


def _cut_apart(origin: IntArray) -> BoolArray:
    """(E, E) whether two ends were one strand before it was cut between them."""
    joined = np.zeros((2 * len(origin), 2 * len(origin)), bool)
    first = np.flatnonzero(origin[1:] == origin[:-1])
    joined[2 * first + 1, 2 * first + 2] = joined[2 * first + 2, 2 * first + 1] = True
    return joined


def _angle(reference: FloatArray, vector: FloatArray) -> FloatArray:
    cross = reference[..., 0] * vector[..., 1] - reference[..., 1] * vector[..., 0]
    angle: FloatArray = np.arctan2(cross, (reference * vector).sum(axis=-1))
    return angle


def _beside(
    ends: PieceEnds, possible: BoolArray, whole: View, width_px: float, params: JoinParams
) -> FloatArray:
    """(E, E) cost of the share of each possible bridge that is beside all strands as they were
    found."""
    cost = np.zeros(possible.shape)
    tree = cKDTree(np.concatenate([s.xy for s in whole.strands]))
    for a, b in np.argwhere(np.triu(possible)).tolist():
        points = _bridge(ends, a, b, ends.tip[a], ends.tip[b])
        if len(points):
            share = float(np.mean(tree.query(points)[0] > 0.6 * width_px))
            cost[a, b] = cost[b, a] = params.beside * share
    return cost


def _bridge(ends: PieceEnds, a: int, b: int, start: FloatArray, stop: FloatArray) -> FloatArray:
    """(m, 2) points about a pixel apart between ``start`` and ``stop``, without them."""
    shares = np.linspace(0, 1, max(int(np.hypot(*(stop - start))), 1) + 1)[1:-1]
    return bridge(start[None], stop[None], ends.outward[[a]], -ends.outward[[b]], shares)[0]


def partners(cost: FloatArray, params: JoinParams) -> IntArray:
    """(E,) the end that each one goes on in, itself where it stops. Ends that no possible join
    connects are decided apart from one another."""
    partner = np.arange(len(cost))
    group = components(np.argwhere(cost < params.dearest), len(cost))
    for number in np.flatnonzero(np.bincount(group) > 1):
        members = np.flatnonzero(group == number)
        partner[members] = members[_sure_partners(cost[np.ix_(members, members)], params)]
    return partner


def _sure_partners(cost: FloatArray, params: JoinParams) -> IntArray:
    """The cheapest partners of a few ends, without the joins that another way nearly equals."""
    found, total = _cheapest(cost, params.dearest)
    sure = found.copy()
    for a in np.flatnonzero(found > np.arange(len(found))).tolist():
        other = cost.copy()
        other[a, found[a]] = other[found[a], a] = np.inf
        if _cheapest(other, params.dearest)[1] - total < params.margin:
            sure[[a, found[a]]] = a, found[a]
    return sure


def _cheapest(cost: FloatArray, stop: float) -> tuple[IntArray, float]:
    """Partners with the least total; two ends that stop cost as much as a join of ``stop``."""
    pairs = np.argwhere(np.triu(cost < stop, 1))
    partner = match(len(cost), pairs, cost[tuple(pairs.T)], np.full(len(cost), stop / 2))
    alone = np.arange(len(cost))
    return partner, float(np.where(partner == alone, stop, cost[alone, partner]).sum()) / 2


def _joined(
    own: _Pieces,
    ends: PieceEnds,
    partner: IntArray,
    width_px: float,
    count: int,
    params: JoinParams,
) -> Rejoined:
    chains = [entered for entered, _ in follow(partner)]
    share = np.zeros((len(chains), count))
    for row, chain in enumerate(chains):
        for end in chain:
            share[row, own.origin[end // 2]] += own.view.strands[end // 2].length_px
    short = params.short_widths * width_px
    strands = tuple(_strand(own.view.strands, chain, ends, short) for chain in chains)
    return Rejoined(replace(own.view, strands=strands), share)


def _strand(
    pieces: tuple[Strand, ...], chain: list[int], ends: PieceEnds, short_px: float
) -> Strand:
    parts = [pieces[chain[0] // 2].turned(chain[0] % 2 == 1)]
    for before, end in pairwise(chain):
        piece = pieces[end // 2].turned(end % 2 == 1)
        start, stop = parts[-1].xy[-1], piece.xy[0]
        filled = _bridge(ends, before ^ 1, end, start, stop)
        width = np.linspace(parts[-1].width_px[-1], piece.width_px[0], len(filled))
        known = np.full(len(filled), float(np.hypot(*(stop - start))) < short_px)
        parts += [Strand(filled, np.zeros_like(filled), width, known), piece]
    if len(parts) == 1:
        return parts[0]
    xy, width, known = (
        np.concatenate([getattr(p, name) for p in parts]) for name in ("xy", "width_px", "known")
    )
    return Strand.through(xy, width, known)
