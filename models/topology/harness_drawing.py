"""Which section is which branch of the harness drawing (beyond the thesis, its 6.8.7 names it as
future work).

Strategy: drawing and picture are trees of branches; a match keeps neighbors neighbors. One drawn
branch is laid on one section, either way round, and from there the match grows outwards: at every
pair of points the branches that leave them are assigned so that lengths agree best. All starts are
tried and the cheapest match wins. The scale, pixels per unit, is either given or follows from the
match itself: from the start's own lengths first, then as the median of all ratios.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linear_sum_assignment

from models.topology.scene import Topology

_UNMATCHED = 0.8
"""Cost of a branch that has no counterpart, in log length."""
_CONNECTOR = 0.3
"""Cost of a connector in the drawing where the picture shows a plain end, or the reverse."""
_BULKY = 1.45
"""An end so much wider than its section carries a connector."""
_AMBIGUOUS = 0.05
"""Two matches whose costs differ by less than this a branch count as equal."""
_DROPPED = 0.15
"""Cost of a short free section that is taken off."""
_MOST_DROPPED = 4
_SHORT = 0.6
"""Only sections shorter than this share of the typical one are taken off."""
_BEYOND, _LENGTH_BEYOND = 0.25, 0.2
"""Cost of a branch more or less beyond a branch-point, and of how its length differs there."""
_CUT_OFF = 0.3
"""How much cheaper it is that a section which leaves the picture is shorter than drawn."""


@dataclass(frozen=True)
class Drawn:
    """A branch of the drawing between two named points."""

    name: str
    a: str
    b: str
    length: float


@dataclass(frozen=True)
class Match:
    """``sections``: drawn branch's name to the indices of the sections that are it, in order;
    ``points``: drawn point's name to branch-point index; ``costs`` by name; ``scale`` px per unit,
    None if nothing matched."""

    sections: dict[str, tuple[int, ...]]
    points: dict[str, int]
    costs: dict[str, float]
    missing: tuple[str, ...]
    extra: tuple[int, ...]
    scale: float | None
    cost: float
    ambiguous: bool


@dataclass(frozen=True)
class _Piece:
    """Sections in a row that are taken for one branch. ``points``: what is at its ends, a
    branch-point's index or ``(section, end)`` of a free end; ``cut``: it leaves the picture;
    ``bulky``: a connector shows at either end."""

    sections: tuple[int, ...]
    length: float
    points: tuple[object, object]
    cut: bool
    bulky: tuple[bool | None, bool | None]

    def turned(self) -> _Piece:
        return _Piece(
            self.sections[::-1], self.length, self.points[::-1], self.cut, self.bulky[::-1]
        )


@dataclass(frozen=True)
class _Edge:
    """A branch or section as seen from one of its points: ``there`` is the other one; ``cut``: it
    leaves the picture; ``bulky``: a connector sits at ``there``, None where that is not known."""

    key: int
    there: object
    length: float
    cut: bool
    bulky: bool | None


@dataclass
class _Trial:
    """A match that is growing."""

    pairs: dict[int, int] = field(default_factory=dict)
    points: dict[object, object] = field(default_factory=dict)
    costs: dict[int, float] = field(default_factory=dict)


def match_drawing(
    topology: Topology,
    branches: list[Drawn],
    connectors: Iterable[str] = (),
    scale: float | None = None,
) -> Match:
    """The best match of drawing and picture. ``scale`` in px per unit of the drawing, or None to
    estimate it.

    The drawing may know better than the picture: short free sections that fit nowhere (a clip, a
    burr) are taken off one by one, so that the sections on either side become one branch, as long
    as the match gets cheaper.
    """
    drawn = _drawn_tree(branches, set(connectors))
    pieces = _pieces(topology)
    found: list[_Found] = []
    for dropped in range(_MOST_DROPPED + 1):
        found += _matches(drawn, pieces, branches, scale, dropped)
        shorter = _without_shortest(pieces)
        if shorter is None or len(pieces) <= len(branches):
            break
        pieces = shorter
    if not found:
        everything = tuple(b.name for b in branches)
        return Match(
            {}, {}, {}, everything, tuple(range(len(topology.sections))), scale, 1.0, False
        )
    best = min(found, key=lambda f: f.cost)
    rivals = [f.cost for f in found if f.named() != best.named()]
    names = {branches[d].name: sections for d, sections in best.named().items()}
    used = {k for sections in names.values() for k in sections}
    return Match(
        names,
        {str(p): q for p, q in best.trial.points.items() if isinstance(q, int)},
        {branches[d].name: c for d, c in best.trial.costs.items()},
        tuple(b.name for b in branches if b.name not in names),
        tuple(k for k in range(len(topology.sections)) if k not in used),
        best.scale,
        best.cost,
        bool(rivals) and min(rivals) - best.cost < _AMBIGUOUS,
    )


@dataclass(frozen=True)
class _Found:
    """A finished match of the drawing with some pieces."""

    cost: float
    trial: _Trial
    scale: float
    pieces: list[_Piece]

    def named(self) -> dict[int, tuple[int, ...]]:
        return {d: self.pieces[k].sections for d, k in self.trial.pairs.items()}


def _matches(
    drawn: Mapping[object, list[_Edge]],
    pieces: list[_Piece],
    branches: list[Drawn],
    scale: float | None,
    dropped: int,
) -> list[_Found]:
    """The match from every start; what was dropped costs a little, or everything would be."""
    seen = _seen_tree(pieces)
    return [
        _grown(drawn, seen, branches, pieces, d, s, flipped, scale, _DROPPED * dropped)
        for d in range(len(branches))
        for s in range(len(pieces))
        for flipped in (False, True)
    ]


def _pieces(topology: Topology) -> list[_Piece]:
    pieces = []
    for k, s in enumerate(topology.sections):
        if s.closed:
            continue
        first, last = ((b if b >= 0 else (k, e)) for e, b in enumerate(s.branches))
        bulky = [
            w > _BULKY * s.width if kind == "free" else None
            for w, kind in zip(s.end_widths, s.ends, strict=True)
        ]
        pieces.append(
            _Piece((k,), s.length, (first, last), "border" in s.ends, (bulky[0], bulky[1]))
        )
    return pieces


def _without_shortest(pieces: list[_Piece]) -> list[_Piece] | None:
    """The pieces without the shortest free one that hangs on a branch-point, if it is much shorter
    than the typical piece; two that are then left at the point become one."""
    typical = float(np.median([p.length for p in pieces])) if pieces else 0.0
    free = [
        p
        for p in pieces
        if sum(isinstance(q, int) for q in p.points) == 1 and p.length < _SHORT * typical
    ]
    if not free:
        return None
    gone = min(free, key=lambda p: p.length)
    point = next(q for q in gone.points if isinstance(q, int))
    left = [p for p in pieces if p is not gone]
    meeting = [p for p in left if point in p.points]
    if len(meeting) != 2 or any(p.points[0] == p.points[1] for p in meeting):
        return left
    first = meeting[0] if meeting[0].points[1] == point else meeting[0].turned()
    last = meeting[1] if meeting[1].points[0] == point else meeting[1].turned()
    joined = _Piece(
        first.sections + last.sections,
        first.length + last.length,
        (first.points[0], last.points[1]),
        first.cut or last.cut,
        (first.bulky[0], last.bulky[1]),
    )
    return [p for p in left if p is not meeting[0] and p is not meeting[1]] + [joined]


def _drawn_tree(branches: list[Drawn], connectors: set[str]) -> dict[object, list[_Edge]]:
    tree: dict[object, list[_Edge]] = defaultdict(list)
    for k, b in enumerate(branches):
        for here, there in ((b.a, b.b), (b.b, b.a)):
            tree[here].append(
                _Edge(k, there, b.length, False, there in connectors if connectors else None)
            )
    return tree


def _seen_tree(pieces: list[_Piece]) -> dict[object, list[_Edge]]:
    tree: dict[object, list[_Edge]] = defaultdict(list)
    for k, piece in enumerate(pieces):
        for end in (0, 1):
            edge = _Edge(k, piece.points[1 - end], piece.length, piece.cut, piece.bulky[1 - end])
            tree[piece.points[end]].append(edge)
    return tree


def _grown(
    drawn: Mapping[object, list[_Edge]],
    seen: Mapping[object, list[_Edge]],
    branches: list[Drawn],
    pieces: list[_Piece],
    d: int,
    s: int,
    flipped: bool,
    scale: float | None,
    extra_cost: float,
) -> _Found:
    """The match that grows from one pair; with a free scale it is grown again at the scale that it
    implies."""
    trial, used = _Trial(), scale or pieces[s].length / branches[d].length
    for _ in range(1 if scale else 3):
        trial = _start(
            drawn, seen, branches[d], d, pieces[s].turned() if flipped else pieces[s], s, used
        )
        ratios = [
            pieces[k].length / branches[b].length
            for b, k in trial.pairs.items()
            if not pieces[k].cut
        ]
        if scale or not ratios or abs(np.log(np.median(ratios) / used)) < 0.01:
            break
        used = float(np.median(ratios))
    free = len(branches) + len(pieces) - 2 * len(trial.pairs)
    cost = (sum(trial.costs.values()) + _UNMATCHED * free + extra_cost) / max(len(branches), 1)
    return _Found(cost, trial, used, pieces)


def _start(
    drawn: Mapping[object, list[_Edge]],
    seen: Mapping[object, list[_Edge]],
    branch: Drawn,
    d: int,
    piece: _Piece,
    s: int,
    scale: float,
) -> _Trial:
    trial = _Trial()
    trial.pairs[d] = s
    trial.costs[d] = _cost(
        _Edge(d, None, branch.length, False, None),
        _Edge(s, None, piece.length, piece.cut, None),
        scale,
    )
    for point, place in zip((branch.a, branch.b), piece.points, strict=True):
        trial.points[point] = place
        _grow(trial, drawn, seen, point, place, scale)
    return trial


def _grow(
    trial: _Trial,
    drawn: Mapping[object, list[_Edge]],
    seen: Mapping[object, list[_Edge]],
    point: object,
    place: object,
    scale: float,
) -> None:
    """Assign the branches that leave ``point`` to the sections that leave ``place``, then go on
    from their far ends."""
    wanted = [e for e in drawn[point] if e.key not in trial.pairs]
    taken = set(trial.pairs.values())
    found = [e for e in seen[place] if e.key not in taken]
    if not wanted or not found:
        return
    # Looking ahead: a branch fits better where as much hangs on its far end as in the drawing.
    table = np.array(
        [
            [_cost(w, f, scale) + _shape_cost(drawn, seen, w, f, scale) for f in found]
            for w in wanted
        ]
    )
    padded = np.full((len(wanted) + len(found),) * 2, 0.0)
    padded[: len(wanted), : len(found)] = table
    padded[: len(wanted), len(found) :] = 2 * _UNMATCHED
    padded[len(wanted) :, : len(found)] = 2 * _UNMATCHED
    rows, columns = linear_sum_assignment(padded)
    for r, c in zip(rows, columns, strict=True):
        if r >= len(wanted) or c >= len(found) or found[c].key in trial.pairs.values():
            continue
        trial.pairs[wanted[r].key] = found[c].key
        trial.costs[wanted[r].key] = _cost(wanted[r], found[c], scale)
        trial.points[wanted[r].there] = found[c].there
        _grow(trial, drawn, seen, wanted[r].there, found[c].there, scale)


def _cost(wanted: _Edge, found: _Edge, scale: float) -> float:
    """Difference of the lengths' logarithms; a section that leaves the picture may well be longer
    than it looks."""
    difference = float(np.log(max(found.length, 1.0) / (wanted.length * scale)))
    other_end = None not in (wanted.bulky, found.bulky) and wanted.bulky != found.bulky
    return (
        abs(difference) * (_CUT_OFF if found.cut and difference < 0 else 1.0)
        + _CONNECTOR * other_end
    )


def _shape_cost(
    drawn: Mapping[object, list[_Edge]],
    seen: Mapping[object, list[_Edge]],
    wanted: _Edge,
    found: _Edge,
    scale: float,
) -> float:
    """Difference in number of branches beyond, and of their summed length, discounted."""
    count = [len(tree[e.there]) - 1 for tree, e in ((drawn, wanted), (seen, found))]
    beyond = [
        sum(e.length for e in tree[edge.there] if e.key != edge.key)
        for tree, edge in ((drawn, wanted), (seen, found))
    ]
    difference = _BEYOND * abs(count[0] - count[1]) * (_CUT_OFF if found.cut else 1.0)
    if min(beyond) > 0:
        difference += _LENGTH_BEYOND * abs(float(np.log(beyond[1] / (beyond[0] * scale))))
    return difference
