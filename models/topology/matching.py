"""Which section is which branch of the harness drawing (beyond the thesis, its 6.8.7 names it as future work).

Strategy: drawing and picture are trees of branches; a match keeps neighbors neighbors. One drawn branch is laid on one
section, either way round, and from there the match grows outwards: at every pair of points the branches that leave them
are assigned so that lengths agree best. All starts are tried and the cheapest match wins. The scale, pixels per unit,
is either given or follows from the match itself: from the start's own lengths first, then as the median of all ratios.
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
"""Two matches whose costs differ by less than this a branch cannot be told apart."""
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
    """``sections``: drawn branch's name to section index; ``points``: drawn point's name to branch-point index;
    ``costs`` by name; ``scale`` px per unit, None if nothing matched."""

    sections: dict[str, int]
    points: dict[str, int]
    costs: dict[str, float]
    missing: tuple[str, ...]
    extra: tuple[int, ...]
    scale: float | None
    cost: float
    ambiguous: bool


@dataclass(frozen=True)
class _Edge:
    """A branch or section as seen from one of its points: ``there`` is the other one; ``cut``: it leaves the picture;
    ``bulky``: a connector sits at ``there``, None where that is not known."""

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
    topology: Topology, branches: list[Drawn], connectors: Iterable[str] = (), scale: float | None = None
) -> Match:
    """The best match of drawing and picture. ``scale`` in px per unit of the drawing, or None to estimate it."""
    drawn, seen = _drawn_tree(branches, set(connectors)), _seen_tree(topology)
    results: list[tuple[float, dict[int, int], _Trial, float]] = []
    sections = [k for k, s in enumerate(topology.sections) if not s.closed]
    for d, branch in enumerate(branches):
        for s in sections:
            for flipped in (False, True):
                start = scale or topology.sections[s].length / branch.length
                result = _grown(drawn, seen, branches, topology, d, s, flipped, start, scale is not None)
                results.append(result)
    if not results:
        everything = tuple(b.name for b in branches)
        return Match({}, {}, {}, everything, tuple(range(len(topology.sections))), scale, 1.0, False)
    results.sort(key=lambda r: r[0])
    cost, pairs, trial, used = results[0]
    rivals = [r for r in results[1:] if r[1] != pairs]
    ambiguous = bool(rivals) and rivals[0][0] - cost < _AMBIGUOUS
    names = {branches[d].name: s for d, s in pairs.items()}
    points = {str(p): int(q) for p, q in trial.points.items() if isinstance(q, int) and q >= 0}
    return Match(
        names, points, {branches[d].name: c for d, c in trial.costs.items()},
        tuple(b.name for b in branches if b.name not in names),
        tuple(k for k in range(len(topology.sections)) if k not in pairs.values()),
        used, cost, ambiguous,
    )  # fmt: skip


def _drawn_tree(branches: list[Drawn], connectors: set[str]) -> dict[object, list[_Edge]]:
    tree: dict[object, list[_Edge]] = defaultdict(list)
    for k, b in enumerate(branches):
        for here, there in ((b.a, b.b), (b.b, b.a)):
            tree[here].append(_Edge(k, there, b.length, False, there in connectors if connectors else None))
    return tree


def _seen_tree(topology: Topology) -> dict[object, list[_Edge]]:
    """Branch-points by index; a free end of section k is ``(k, end)``."""
    tree: dict[object, list[_Edge]] = defaultdict(list)
    for k, s in enumerate(topology.sections):
        points = [b if b >= 0 else (k, e) for e, b in enumerate(s.branches)]
        for end in (0, 1):
            bulky = s.end_widths[1 - end] > _BULKY * s.width if s.ends[1 - end] == "free" else None
            tree[points[end]].append(_Edge(k, points[1 - end], s.length, "border" in s.ends, bulky))
    return tree


def _grown(
    drawn: Mapping[object, list[_Edge]], seen: Mapping[object, list[_Edge]], branches: list[Drawn],
    topology: Topology, d: int, s: int, flipped: bool, scale: float, fixed: bool,
) -> tuple[float, dict[int, int], _Trial, float]:  # fmt: skip
    """The match that grows from one pair; with a free scale it is grown again at the scale that it implies."""
    trial, used = _Trial(), scale
    for _ in range(1 if fixed else 3):
        trial = _Trial()
        _start(trial, drawn, seen, branches, topology, d, s, flipped, used)
        ratios = [topology.sections[k].length / branches[b].length for b, k in trial.pairs.items()
                  if "border" not in topology.sections[k].ends]  # fmt: skip
        if fixed or not ratios or abs(np.log(np.median(ratios) / used)) < 0.01:
            break
        used = float(np.median(ratios))
    free = len(branches) - len(trial.pairs) + len(topology.sections) - len(trial.pairs)
    cost = (sum(trial.costs.values()) + _UNMATCHED * free) / max(len(branches), 1)
    return cost, trial.pairs, trial, used


def _start(
    trial: _Trial, drawn: Mapping[object, list[_Edge]], seen: Mapping[object, list[_Edge]], branches: list[Drawn],
    topology: Topology, d: int, s: int, flipped: bool, scale: float,
) -> None:  # fmt: skip
    branch, section = branches[d], topology.sections[s]
    ends: list[object] = [b if b >= 0 else (s, e) for e, b in enumerate(section.branches)]
    if flipped:
        ends.reverse()
    trial.pairs[d] = s
    edge = _Edge(s, None, section.length, "border" in section.ends, None)
    trial.costs[d] = _cost(_Edge(d, None, branch.length, False, None), edge, scale)
    for point, place in zip((branch.a, branch.b), ends, strict=True):
        trial.points[point] = place
        _grow(trial, drawn, seen, point, place, scale)


def _grow(
    trial: _Trial, drawn: Mapping[object, list[_Edge]], seen: Mapping[object, list[_Edge]], point: object,
    place: object, scale: float,
) -> None:  # fmt: skip
    """Assign the branches that leave ``point`` to the sections that leave ``place``, then go on from their far ends."""
    wanted = [e for e in drawn[point] if e.key not in trial.pairs]
    taken = set(trial.pairs.values())
    found = [e for e in seen[place] if e.key not in taken]
    if not wanted or not found:
        return
    # Looking ahead: a branch fits better where as much hangs on its far end as in the drawing.
    table = np.array([
        [_cost(w, f, scale) + _shape_cost(drawn, seen, w, f, point, place, scale) for f in found] for w in wanted
    ])  # fmt: skip
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
    """Difference of the lengths' logarithms; a section that leaves the picture may well be longer than it looks."""
    difference = float(np.log(max(found.length, 1.0) / (wanted.length * scale)))
    other_end = None not in (wanted.bulky, found.bulky) and wanted.bulky != found.bulky
    return abs(difference) * (_CUT_OFF if found.cut and difference < 0 else 1.0) + _CONNECTOR * other_end


def _shape_cost(
    drawn: Mapping[object, list[_Edge]], seen: Mapping[object, list[_Edge]], wanted: _Edge, found: _Edge,
    point: object, place: object, scale: float,
) -> float:  # fmt: skip
    """Difference in number of branches beyond, and of their summed length, discounted."""
    count = [len(tree[e.there]) - 1 for tree, e in ((drawn, wanted), (seen, found))]
    beyond = [sum(e.length for e in tree[edge.there] if e.key != edge.key) for tree, edge in
              ((drawn, wanted), (seen, found))]  # fmt: skip
    difference = 0.25 * abs(count[0] - count[1]) * (0.3 if found.cut else 1.0)
    if min(beyond) > 0:
        difference += 0.2 * abs(float(np.log(beyond[1] / (beyond[0] * scale))))
    return difference
