"""The next pick-and-place (or pull) for a DLO among fixtures: around pegs, into clips.

Strategy: the network has no model of contact, so dry friction with contact (:mod:`sliding`,
:mod:`contact`) foresees what an action does. The distance to the target is the mean way of the
DLO's points around the fixtures (:mod:`detours`), which has no rest where the DLO is on the wrong
side of a peg: there the way leads back around it, so an end is pulled out and threaded. For several
edges the move along the first straight leg of this way, as far as one action reaches, and for every
clip the move that presses the edge in that belongs there, each with a few turns; all are simulated
roughly in one batch, and what seems best then exactly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from models.geometry.polylines import crossing_segments, resample
from models.manipulation.actions import Candidates
from models.manipulation.contact import pushes
from models.manipulation.detours import detours, string_ways
from models.manipulation.dynamics import shape_distance
from models.manipulation.fixtures import Fixtures, in_clip
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.limits import Limits, checks
from models.manipulation.routes import Route
from models.manipulation.sliding import Contact, Sliders, SlidingParams, ways_slid
from models.manipulation.swept import enters

FINE = 31
"""Nodes of a DLO among fixtures: a peg needs shorter edges than the networks have."""
_COARSE = 16
_SLIDING = SlidingParams(steps=24, slip_m=3e-4, released=6)
_ROUGH = SlidingParams(steps=8, slip_m=9e-4, released=2)
"""The same in a third of the time, to choose what is worth it."""
_PROMISING = 12
"""Actions that are foreseen exactly at a time …"""
_ENOUGH = 2
"""… until so many of them can be done."""
_GRASPS = np.array([0, 5, 10, 15, 20, 25, 29])
"""Edges that are gripped."""
_LEGS = ((1.0, 0.0, True), (0.5, 0.0, True), (1.0, 0.6, False), (1.0, -0.6, False))
"""Share of the first leg, how far its direction is turned, and whether with every turn of the
edge."""
_TURNS = np.array([-1.0, 0.0, 1.0])
"""Turns of an edge, as shares of the largest, beside the one to its direction in the target."""
_STIFFNESSES = np.geomspace(0.03, 2.0, 8)
_USUAL_M, _SPREAD = 0.2, 1.0
"""Stiffnesses in m that are tried; the usual one, and the spread of the logarithm about it."""
_NOISE_M, _NOISE_SHARE = 2e-3, 0.1
"""What the right stiffness leaves of a motion: of cameras, and of the motion itself."""
_EVERY = 3
"""Points of which the way counts."""
_JAMMED_M = 2.5e-3
"""Depth in a fixture from which an action is not one that a real DLO follows."""
_UNFILLED_M = 0.02
"""What a clip that is not filled yet, or a peg with too much room, counts beside the mean way."""


@dataclass(frozen=True, eq=False)
class Goal:
    """The shape (31, 2) that a DLO should have, and the route that this is of, None where only the
    shape counts."""

    shape: FloatArray
    route: Route | None = None

    def reached(self, state: FloatArray, fixtures: Fixtures, tolerance: float) -> bool:
        """Whether a DLO (31, 2) is on the route; without one, within the tolerance in m of the
        shape."""
        if self.route is not None:
            return not self.route.missed(state)
        return float(self.away(state[None], fixtures)[0]) <= tolerance

    def away(self, states: FloatArray, fixtures: Fixtures) -> FloatArray:
        """(B,) m, the mean way of the points of DLOs (B, 31, 2) to their places."""
        return detours(states, self.shape, fixtures).mean(1)

    def cost(self, states: FloatArray, fixtures: Fixtures) -> FloatArray:
        """(B,) m of DLOs (B, 31, 2) by which actions are ranked."""
        ways = detours(states, self.shape, fixtures, _EVERY)
        way = (ways.mean(1) + ways.max(1)) / 2
        if self.route is None:
            return way
        return way + _UNFILLED_M * self.route.misses(states)


@dataclass(frozen=True, eq=False)
class World:
    """Fixtures, limits, and the stiffness s in m of the DLO over its friction, in nodes of the
    coarse chain."""

    fixtures: Fixtures
    limits: Limits
    stiffness: float = 0.25

    def ways(
        self,
        states: FloatArray,
        edges: IntArray,
        moves: FloatArray,
        stiffness: FloatArray | None = None,
        params: SlidingParams = _SLIDING,
    ) -> FloatArray:
        """(B, T, 31, 2) shapes during B actions on DLOs (B, 31, 2), the last one after it; by
        default of the one stiffness."""
        finer = (FINE - 1) / (_COARSE - 1)
        stiff = np.full(len(edges), self.stiffness) if stiffness is None else stiffness
        return ways_slid(
            states, edges, moves, Sliders.straight(stiff * finer**2, FINE), params, self._contact_of
        )

    def _contact_of(self, shapes: FloatArray) -> Contact:
        held = self.fixtures.filled(shapes)
        return lambda now: pushes(now, self.fixtures, held)


def routed(world: World, state: FloatArray, goal: Goal, most: int = 4) -> Candidates:
    """At most so many actions for a DLO (31, 2), best first; ``edge`` counts the fine edges,
    ``error`` is the goal's cost."""
    edges, moves = _proposed(world, state, goal)
    possible = _reachable(world, state, edges, moves)
    edges, moves = edges[possible], moves[possible]
    order = _promising(world, state, goal, edges, moves)
    found = Candidates(
        edges[:0], moves[:0], np.zeros((0, *state.shape)), np.zeros(0), np.zeros(0, bool)
    )
    for first in range(0, len(order), _PROMISING):
        rows = order[first : first + _PROMISING]
        found = found.joined(_foreseen(world, state, goal, edges[rows], moves[rows], most))
        if len(found.edge) >= min(most, _ENOUGH):
            break
    return found.taken(np.argsort(found.error, kind="stable")[:most])


def _promising(
    world: World, state: FloatArray, goal: Goal, edges: IntArray, moves: FloatArray
) -> IntArray:
    """Rows of the actions, best first, by what a rough look foresees: how far it leaves the DLO
    from the goal, and how deep it has it in a fixture on the way."""
    if not len(edges):
        return edges
    states = np.broadcast_to(state, (len(edges), *state.shape))
    ways = world.ways(states, edges, moves, params=_ROUGH)
    finite = np.flatnonzero(np.isfinite(ways).all((1, 2, 3)))
    ways = ways[finite]
    cost = goal.cost(ways[:, -1], world.fixtures) + _depth(world, ways)
    return np.asarray(finite[np.argsort(cost, kind="stable")])


def _foreseen(
    world: World, state: FloatArray, goal: Goal, edges: IntArray, moves: FloatArray, most: int
) -> Candidates:
    """At most so many of some actions that a real DLO can follow within the limits, with what they
    lead to."""
    states = np.broadcast_to(state, (len(edges), *state.shape))
    ways = np.concatenate([states[:, None], world.ways(states, edges, moves)], 1)
    found = Candidates(edges, moves, ways[:, -1], np.zeros(len(edges)), np.ones(len(edges), bool))
    kept = np.array([k for k in range(len(edges)) if _sound(world, found, k, ways[k])], np.int64)
    kept = kept[_depth(world, ways[kept]) <= _JAMMED_M]
    if not len(kept):
        return found.taken(kept)
    found, ways = (
        replace(found.taken(kept), error=goal.cost(ways[kept, -1], world.fixtures)),
        ways[kept],
    )
    order = np.argsort(found.error, kind="stable").tolist()
    clear = (
        k
        for k in order
        if not any(enters(ways[k], zone) for zone in [*_cores(world), *world.limits.zones])
    )
    return found.taken(np.array(list(islice(clear, most)), np.int64))


def _sound(world: World, found: Candidates, k: int, way: FloatArray) -> bool:
    """Whether action ``k`` comes to an end (T, 31, 2) without the DLO meeting itself there, and
    keeps the limits."""
    if not np.isfinite(way).all() or len(crossing_segments(way[-1, :-1], way[-1, 1:]).xy):
        return False
    return all(c.passed for c in checks(way[0], found, k, world.limits))


def _depth(world: World, ways: FloatArray) -> FloatArray:
    """(C,) m, the deepest that shapes on a way (C, T, 31, 2) are in a fixture."""
    shapes = ways.reshape(-1, *ways.shape[2:])
    met = pushes(shapes, world.fixtures, np.zeros((len(shapes), len(world.fixtures.clips)), bool))
    deepest = np.zeros(len(shapes))
    np.maximum.at(deepest, met.sim, met.depth)
    return deepest.reshape(ways.shape[:2]).max(1, initial=0.0)


def _cores(world: World) -> list[FloatArray]:
    """Segments (2, 2) within every capsule. What sweeps over one has gone through it, in a step too
    long to see it."""
    start, end = world.fixtures.start, world.fixtures.end
    short = 0.1 * world.fixtures.radius[:, None] * [1.0, 0.0]
    return list(np.stack([start - short, end + short], 1))


def _proposed(world: World, state: FloatArray, goal: Goal) -> tuple[IntArray, FloatArray]:
    edges, moves = [], []
    grasps = np.setdiff1d(_GRASPS, world.limits.no_grasp).tolist()
    ways = string_ways(state, goal.shape, world.fixtures, grasps)
    for edge, way in zip(grasps, ways, strict=True):
        leg = _first_leg(way, state, goal.shape, edge)
        turn = _turn(state, goal.shape, edge)
        for share, off, every in _LEGS:
            for wish in [turn, *(_TURNS * world.limits.largest[2])] if every else [turn, 0.0]:
                edges.append(edge)
                moves.append([*_within(share * _turned(leg, off), world.limits.largest[:2]), wish])
        along = (state[edge + 1] - state[edge]) / np.hypot(*(state[edge + 1] - state[edge]))
        for pull in (-1.0, 1.0):
            edges.append(edge)
            moves.append([*_within(pull * along, world.limits.largest[:2]), 0.0])
    for clip_edge, move in _pressing(world, state, goal):
        edges.append(clip_edge)
        moves.append(move.tolist())
    bound = world.limits.largest
    return np.array(edges, np.int64), np.clip(np.array(moves).reshape(-1, 3), -bound, bound)


def _turned(shift: FloatArray, by: float) -> FloatArray:
    cos, sin = np.cos(by), np.sin(by)
    return np.array([cos * shift[0] - sin * shift[1], sin * shift[0] + cos * shift[1]])


def _within(shift: FloatArray, largest: FloatArray) -> FloatArray:
    """The shift, shortened in its direction to what one action may do."""
    return shift * min(1.0, float((largest / np.maximum(np.abs(shift), 1e-12)).min()))


def _first_leg(way: FloatArray, state: FloatArray, target: FloatArray, edge: int) -> FloatArray:
    """(2,) m from an edge's middle to the first bend of the way (k, 2) to its place."""
    if len(way) > 2:
        return np.asarray(way[1] - way[0])
    return np.asarray(target[edge : edge + 2].mean(0) - state[edge : edge + 2].mean(0))


def _turn(state: FloatArray, target: FloatArray, edge: int) -> float:
    a, b = state[edge + 1] - state[edge], target[edge + 1] - target[edge]
    return float(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b))


def _pressing(world: World, state: FloatArray, goal: Goal) -> list[tuple[int, FloatArray]]:
    """For every clip of the route that is empty, edges about the one that belongs in it, pressed
    in."""
    found = []
    stops = [] if goal.route is None else goal.route.stops
    for clip in [s.clip for s in stops if s.clip is not None and in_clip(s.clip, state) is None]:
        at = in_clip(clip, goal.shape)
        if at is None:
            continue
        for edge in np.unique(np.clip(int(at) + np.array([-2, -1, 0, 1, 2]), 0, FINE - 2)).tolist():
            here = state[edge + 1] - state[edge]
            there = (
                np.sign((goal.shape[int(at) + 1] - goal.shape[int(at)]) @ clip.along) or 1.0
            ) * clip.along
            turn = np.arctan2(here[0] * there[1] - here[1] * there[0], here @ there)
            move = np.array([*(clip.xy - state[edge : edge + 2].mean(0)), turn])
            if (np.abs(move) <= world.limits.largest).all():
                found.append((edge, move))
    return found


def _reachable(world: World, state: FloatArray, edges: IntArray, moves: FloatArray) -> IntArray:
    """Rows whose gripper keeps clear of all capsules on its straight way, and does not hold a
    clip's part."""
    middle = (state[edges] + state[edges + 1]) / 2
    clear = (world.fixtures.gap(middle, middle + moves[:, :2]) > world.limits.gripper).all(1)
    held = [in_clip(clip, state) for clip in world.fixtures.clips]
    outside = np.array(
        [all(h is None or abs(h - e - 0.5) > 1.0 for h in held) for e in edges.tolist()], bool
    )
    return np.flatnonzero(clear & outside)


def likely_stiffness(
    world: World, before: FloatArray, edges: IntArray, moves: FloatArray, after: FloatArray
) -> float:
    """The stiffness s in m under which simulations with contact explain best what M actions did,
    from ``before`` to ``after`` (M, 31, 2). Without actions the usual one."""
    tried, items = len(_STIFFNESSES), len(edges)
    cost = (np.log(_STIFFNESSES / _USUAL_M) / _SPREAD) ** 2
    if items:
        stiffness = np.repeat(_STIFFNESSES, items)
        every = np.tile(before, (tried, 1, 1)), np.tile(edges, tried), np.tile(moves, (tried, 1))
        reached = world.ways(*every, stiffness, _ROUGH)[:, -1].reshape(tried, items, FINE, 2)
        noise = _NOISE_M + _NOISE_SHARE * shape_distance(before, after)
        cost = cost + 2 * np.log1p((shape_distance(reached, after) / noise) ** 2).sum(1)
    return float(_STIFFNESSES[np.argmin(cost)])


def fine(points: FloatArray) -> FloatArray:
    """(N, 2) to (31, 2) at equal arc length."""
    return resample(points, FINE)
