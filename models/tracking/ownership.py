"""Which tracked cable every place of the observations belongs to.

Strategy: all observations are sampled along their length. Each sample is the less likely to be a
cable's, the further it is from where the cable is expected, in units of how well that is known, and
the more its direction differs. Along an observation the owner changes only where a single picture
may go on with the wrong strand: at a crossing, beside another strand, over a bridged gap. Elsewhere
one strand is one cable, whatever was thought of it before. The most likely sequence of owners is
found by dynamic programming (Viterbi), for all observations at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.geometry.polylines import arc_lengths, point_at
from models.tracking.state import NODES, Observation, TrackedCable

_STEP_WIDTHS, _FEWEST, _MOST = 1.0, 4, 160
"""Between samples; how many an observation has at least and at most."""
_KNOWN_WIDTHS = 0.5
"""How far a node that was seen a frame ago may be from where it is expected."""
_NOBODY = 2.2
"""Cost of a sample that belongs to no known cable: as if one were met about 1.5 widths off."""
_FARTHEST = 3.0
_ANGLE = 2.0
"""Cost of a direction at right angles to the cable's."""
_COLOR, _MOTTLED, _COLOR_COST = 25.0, 2.0, 3.0
"""Lab distance that costs so much, and so many times what the color varies more on a cable that is
not of one."""
_CHANGE, _NEVER, _CHANGE_IN_GAP, _UNSEEN = 4.0, 1e4, 1.0, 20.0
"""Cost of a change of owner, where it is possible, elsewhere, and in a long gap; more for a place
of the new owner that was not in view, where the picture shows clearly that a strand goes on."""
_NEAR_WIDTHS, _BESIDE_WIDTHS = 1.5, 2.0
"""So far from a crossing along the strand, and from another strand, the owner may change."""
TANGLED_WIDTHS, _TRUST_IN_TANGLE = 6.0, 0.15
"""A crossing is no longer. Strands that run beside one another are not told apart by a single
picture."""
_OF_BRIDGED = 0.1
"""Share of its cost that a sample counts where there is no foreground; a change of owner is cheap
there, too."""
_LONG_GAP = 5
"""So many samples, about a width each, are more than a crossing or a blur."""
_OUTWARD = 0.25
"""Beyond an end that was never in view a cable goes on: distance counts this share there."""
_OUT_OF_REACH_SPREADS = 8.0
_INNER_WIDTHS = 3.0
"""A place of an observation that is so far from both of its ends is not one of them."""


class Samples(NamedTuple):
    """P places on O observations in order. ``xy``, ``direction`` (P, 2); ``along`` (P,) px from the
    observation's first point; ``of`` (P,) index of the observation; ``loose`` (P,) where a picture
    may go on with the wrong strand; ``weight`` (P,) of its cost; ``trust`` (P,) how surely the
    strand before it is the one after it; ``left`` (P,) where one strand left the picture and
    another one came in: the picture joined them at its border; ``gap`` (P,) in a long gap that was
    bridged, as under an arm: what is before it need not be what is after it; ``tree`` of ``xy``."""

    xy: FloatArray
    direction: FloatArray
    along: FloatArray
    of: IntArray
    loose: BoolArray
    weight: FloatArray
    trust: FloatArray
    left: BoolArray
    gap: BoolArray
    tree: cKDTree


class _Sampled(NamedTuple):
    """The samples of one observation."""

    xy: FloatArray
    direction: FloatArray
    along: FloatArray
    loose: BoolArray
    weight: FloatArray
    left: BoolArray


class Run(NamedTuple):
    """Samples ``first`` to ``stop`` (exclusive), of one observation, belong to the cable of index
    ``cable``, -1 for none; ``along`` (n,) px from its first point, ``xy`` (n, 2), ``place`` (n,) px
    along the cable; ``cost`` of each by cable and, last, by none; ``trust`` (n,) as of the samples;
    ``came_in`` whether what is before it left the picture."""

    cable: int
    observed: Observation
    first: int
    stop: int
    along: FloatArray
    xy: FloatArray
    place: FloatArray
    cost: FloatArray
    trust: FloatArray
    came_in: bool

    @property
    def length_px(self) -> float:
        return float(self.along[-1] - self.along[0])


def sample(observations: Sequence[Observation]) -> Samples:
    """Equally spaced places on every observation, both ends included."""
    parts = [_sampled(observed) for observed in observations]
    of = np.repeat(np.arange(len(parts)), [len(part.xy) for part in parts])
    xy, direction, along, loose, weight, left = (
        np.concatenate(c) for c in zip(*parts, strict=True)
    )
    widths = np.array([observed.width_px for observed in observations])[of]
    tree = cKDTree(xy)
    loose = loose | _beside(tree, of, _BESIDE_WIDTHS * widths)
    gap = _long_gaps(weight, of)
    return Samples(
        xy,
        direction,
        along,
        of,
        loose | left,
        weight,
        _trust(loose, of, along, widths),
        left,
        gap,
        tree,
    )


def _trust(loose: BoolArray, of: IntArray, along: FloatArray, widths: FloatArray) -> FloatArray:
    """(P,) 1 where a strand is alone, a little in a short tangle, nothing in a long one."""
    starts = np.flatnonzero(np.r_[True, (np.diff(of) != 0) | (np.diff(loose) != 0)])
    stops = np.r_[starts[1:], len(of)] - 1
    short = (along[stops] - along[starts] < TANGLED_WIDTHS * widths[starts]) * _TRUST_IN_TANGLE
    value = np.where(loose[starts], short, 1.0)
    return np.asarray(np.repeat(value, np.diff(np.r_[starts, len(of)])))


def _beside(tree: cKDTree, of: IntArray, near: FloatArray) -> BoolArray:
    """Which samples are nearer than ``near`` (P,) px to one of another observation."""
    xy = tree.data
    pairs = tree.query_pairs(float(near.max()), output_type="ndarray")
    first, second = pairs[of[pairs[:, 0]] != of[pairs[:, 1]]].T
    away = np.hypot(*(xy[first] - xy[second]).T)
    beside = np.zeros(len(xy), bool)
    beside[first[away < near[first]]] = True
    beside[second[away < near[second]]] = True
    return beside


def _sampled(observed: Observation) -> _Sampled:
    count = int(np.clip(observed.length_px / (_STEP_WIDTHS * observed.width_px), _FEWEST, _MOST))
    lengths = arc_lengths(observed.xy)
    along = np.linspace(0.0, lengths[-1], count)
    xy = point_at(observed.xy, lengths, along)
    crossings = lengths[-1] * np.array(observed.crossings)
    near = (
        np.abs(along[:, None] - crossings).min(1, initial=np.inf) < _NEAR_WIDTHS * observed.width_px
    )
    weight = np.ones(count)
    if observed.bridged is not None:
        gap = np.interp(along, lengths, observed.bridged) > 0.5
        near |= gap
        weight[gap] = _OF_BRIDGED
    if observed.thick is not None:
        near |= np.interp(along, lengths, observed.thick) > 0.3
    left = np.zeros(count, bool)
    if observed.leaves is not None:
        inner = np.minimum(along, lengths[-1] - along) > _INNER_WIDTHS * observed.width_px
        left = inner & (np.interp(along, lengths, observed.leaves) > 0)
    return _Sampled(xy, directions(xy), along, near, weight, left)


def directions(xy: FloatArray) -> FloatArray:
    """(..., n, 2) unit tangents of polylines."""
    steps = np.empty_like(xy)
    steps[..., 1:-1, :] = xy[..., 2:, :] - xy[..., :-2, :]
    steps[..., 0, :], steps[..., -1, :] = (
        xy[..., 1, :] - xy[..., 0, :],
        xy[..., -1, :] - xy[..., -2, :],
    )
    return np.asarray(steps / np.maximum(np.hypot(steps[..., 0], steps[..., 1]), 1e-9)[..., None])


def runs(
    samples: Samples,
    observations: Sequence[Observation],
    cables: Sequence[TrackedCable],
    costs: FloatArray,
    places: FloatArray,
) -> list[Run]:
    """The stretches of every observation with one owner, in order; none begins or ends in a gap
    that was bridged."""
    owner = _owners(samples, costs, entering(samples, cables, places), len(observations))
    none = costs.shape[1] - 1
    apart = (samples.left[1:] & ~samples.left[:-1]) | (samples.gap[1:] != samples.gap[:-1])
    starts = np.flatnonzero(np.r_[True, (np.diff(owner) != 0) | (np.diff(samples.of) != 0) | apart])
    stops = np.r_[starts[1:], len(owner)]
    found = []
    for first, stop in zip(*_in_view(starts, stops, samples), strict=True):
        i, along = int(owner[first]), samples.along[first:stop]
        place = along if i == none else places[first:stop, i]
        observed = observations[int(samples.of[first])]
        cable = -1 if i == none else i
        found.append(
            Run(
                cable,
                observed,
                first,
                stop,
                along,
                samples.xy[first:stop],
                place,
                costs[first:stop],
                samples.trust[first:stop],
                bool(samples.left[first]),
            )
        )
    return found


def _long_gaps(weight: FloatArray, of: IntArray) -> BoolArray:
    """(P,) in a stretch without foreground that is more than a crossing or a blur."""
    bridged = weight < 1
    starts = np.flatnonzero(np.r_[True, (np.diff(bridged) != 0) | (np.diff(of) != 0)])
    counts = np.diff(np.r_[starts, len(of)])
    return np.asarray(np.repeat(bridged[starts] & (counts >= _LONG_GAP), counts))


def _in_view(starts: IntArray, stops: IntArray, samples: Samples) -> tuple[list[int], list[int]]:
    """The stretches without a long gap at their beginning or end, where something covers the
    cables: what was bridged there shows nothing of where they are. Those that are a gap altogether
    are left out."""
    shown = np.flatnonzero(~samples.gap)
    first, last = np.searchsorted(shown, starts), np.searchsorted(shown, stops) - 1
    some = first <= last
    return shown[first[some]].tolist(), (shown[last[some]] + 1).tolist()


def costs_of(
    samples: Samples,
    observations: Sequence[Observation],
    cables: Sequence[TrackedCable],
    expected: Sequence[FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """(P, C + 1) cost of every sample by cable and by none, and (P, C) where along the cable it
    would be, px."""
    costs = np.full((len(samples.xy), len(cables) + 1), _FARTHEST)
    costs[:, -1] = _NOBODY
    places = np.zeros((len(samples.xy), len(cables)))
    for i, (cable, xy) in enumerate(zip(cables, expected, strict=True)):
        different = np.array([unlike(observed, cable) for observed in observations])[samples.of]
        sigma = np.hypot(_KNOWN_WIDTHS * cable.width_px, cable.spread)
        reach = _OUT_OF_REACH_SPREADS * float(sigma.max())
        low, high = xy.min(0) - reach, xy.max(0) + reach
        near = np.flatnonzero(((samples.xy > low) & (samples.xy < high)).all(1))
        if len(near):
            cost, place = _against(samples.xy[near], samples.direction[near], cable, xy, sigma)
            costs[near, i] = np.minimum(cost + different[near], _FARTHEST)
            places[near, i] = place
    return costs, places


def _against(
    points: FloatArray,
    direction: FloatArray,
    cable: TrackedCable,
    xy: FloatArray,
    sigma: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Cost (n,) and place along the cable (n,) of ``points`` (n, 2) at the best of its nodes ``xy``
    (NODES, 2), each known to ``sigma`` (NODES,) px."""
    tangent = directions(xy)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    # Products of matrices: (a - b) along t is a·t - b·t.
    along = points @ tangent.T - (xy * tangent).sum(1)
    across = points @ normal.T - (xy * normal).sum(1)
    spacing = cable.length_px / (NODES - 1)
    beyond = np.maximum(np.abs(along) - 0.5 * spacing, 0.0)
    for node, outward in ((0, -along[:, 0]), (-1, along[:, -1])):
        if cable.ends[node] != "free":
            beyond[:, node] *= np.where(outward > 0, _OUTWARD, 1.0)
    turned = (direction @ normal.T) ** 2
    squared = (across**2 + beyond**2) / sigma**2
    cost = np.log((1.0 + squared) * (sigma / (_KNOWN_WIDTHS * cable.width_px))) + _ANGLE * turned
    node = cost.argmin(1)
    rows = np.arange(len(points))
    return cost[rows, node], node * spacing + along[rows, node]


def unlike(observed: Observation, cable: TrackedCable) -> float:
    """Cost of what the observation as a whole has unlike the cable."""
    cost = 2.0 * float(np.log(observed.width_px / cable.width_px)) ** 2
    if observed.color is not None and cable.color is not None:
        cost += (
            _COLOR_COST
            * (
                float(np.linalg.norm(observed.color - cable.color))
                / (_COLOR + _MOTTLED * observed.mottled)
            )
            ** 2
        )
    return min(cost, _FARTHEST)


def entering(samples: Samples, cables: Sequence[TrackedCable], places: FloatArray) -> FloatArray:
    """(P, C + 1) cost of a change of owner to each cable, and to none, at every sample."""
    cost = np.full((len(samples.of), len(cables) + 1), _CHANGE)
    for i, cable in enumerate(cables):
        node = np.clip(np.rint(places[:, i] / cable.length_px * (NODES - 1)), 0, NODES - 1).astype(
            int
        )
        cost[:, i] += np.where((samples.trust > 0) & ~cable.seen[node], _UNSEEN, 0.0)
    cost[samples.gap] = _CHANGE_IN_GAP
    cost[~samples.loose] = _NEVER
    return cost


def _owners(samples: Samples, costs: FloatArray, enter: FloatArray, observations: int) -> IntArray:
    """(P,) index of the owner of each sample: the cheapest sequence, changes of owner paid. The
    owner of samples on which it cannot change is found for all of them at once."""
    starts = np.flatnonzero(np.r_[True, (np.diff(samples.of) != 0) | samples.loose[1:]])
    summed = np.add.reduceat(costs * samples.weight[:, None], starts)
    of = samples.of[starts]
    counts = np.bincount(of, minlength=observations)
    longest, labels = int(counts.max()), costs.shape[1]
    step = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts)
    unary = np.zeros((longest, observations, labels))
    unary[step, of] = summed
    change = np.zeros((longest, observations, labels))
    change[step, of] = enter[starts]
    came_from = np.zeros((longest, observations, labels), np.intp)
    total = unary[0]
    stay, rows = np.arange(labels), np.arange(observations)
    for t in range(1, longest):
        best = total.argmin(1)
        switched = total[rows, best][:, None] + change[t]
        switches = switched < total
        came_from[t] = np.where(switches, best[:, None], stay)
        total = np.where(switches, switched, total) + unary[t]
    owner = np.zeros((longest, observations), np.intp)
    owner[-1] = total.argmin(1)
    for t in range(longest - 1, 0, -1):
        owner[t - 1] = came_from[t, rows, owner[t]]
    return np.repeat(owner[step, of], np.diff(np.r_[starts, len(samples.of)]))
