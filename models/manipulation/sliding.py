"""A DLO on a table with dry friction: it stays where the bending moments are too small to move it.

Strategy: quasi-static, so that nothing but the order of motions counts. A chain of edges of fixed
length is given by its first node and its headings. In each small step of the gripper the DLO takes
the shape of least 0.5 s sum (bend - rest)^2 + sum f |displacement|, which is the bending energy and
the work of Coulomb friction, both in units of the friction force of an inner node. The distances
are smoothed and their weights taken from the step before (iteratively reweighted least squares):
one small dense system a DLO and step, all solved in one call. At last the gripper lets go and the
DLO springs back as far as the friction lets it. The thesis's model (:mod:`simulator`) has viscous
friction instead, under which a DLO that is let go creeps until it is straight.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from models.manipulation.contact import Pushes, add_rows
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.simulator import Actions, gripped

STIFFNESS_M = (0.02, 5.0)
"""Range of s in which parameters are looked for: a limp thread to a rod that hardly bends."""
Contact = Callable[[FloatArray], Pushes]
"""Shapes (B, n, 2) to where something pushes them."""


@dataclass(frozen=True)
class SlidingParams:
    """``steps`` of the gripper's way, ``rounds`` of reweighting each; ``slip_m`` below which
    friction grows with the displacement; ``released`` steps after the gripper has let go; ``grip``
    weight of the held nodes' places."""

    steps: int = 8
    rounds: int = 1
    slip_m: float = 1e-3
    released: int = 4
    grip: float = 1e6


@dataclass(frozen=True, eq=False)
class Sliders:
    """B DLOs: ``stiffness`` (B,) s in m, the bending moment of a joint a rad over the friction
    force of an inner node; ``rest`` (B, n - 2) rad, bend angles without load."""

    stiffness: FloatArray
    rest: FloatArray

    @staticmethod
    def straight(stiffness: FloatArray, nodes: int) -> Sliders:
        return Sliders(stiffness, np.zeros((len(stiffness), nodes - 2)))


@dataclass(eq=False)
class _Chains:
    """First nodes (B, 2), headings (B, n - 1) and edge lengths (B, n - 1)."""

    first: FloatArray
    heading: FloatArray
    length: FloatArray

    @staticmethod
    def of(states: FloatArray) -> _Chains:
        edges = np.diff(states, axis=1)
        heading = np.unwrap(np.arctan2(edges[..., 1], edges[..., 0]), axis=1)
        return _Chains(states[:, 0].copy(), heading, np.hypot(edges[..., 0], edges[..., 1]))

    def nodes(self) -> FloatArray:
        found = np.empty((len(self.heading), self.heading.shape[1] + 1, 2))
        found[:, 0] = self.first
        found[:, 1:, 0] = self.length * np.cos(self.heading)
        found[:, 1:, 1] = self.length * np.sin(self.heading)
        return np.cumsum(found, 1, out=found)


def slide(
    states: FloatArray,
    edges: IntArray,
    moves: FloatArray,
    ropes: Sliders,
    params: SlidingParams | None = None,
) -> FloatArray:
    """(B, n, 2) states to those after each action: grip ``edges`` (B,), move by ``moves`` (B, 3),
    let go."""
    return ways_slid(states, edges, moves, ropes, params or SlidingParams())[:, -1]


def ways_slid(
    states: FloatArray,
    edges: IntArray,
    moves: FloatArray,
    ropes: Sliders,
    params: SlidingParams,
    contact_of: Callable[[FloatArray], Contact] | None = None,
) -> FloatArray:
    """(B, T, n, 2) the states after every step of the gripper's way, and at last after it has let
    go.

    ``contact_of`` is asked at the beginning, and again before the gripper lets go: clips hold then
    what was pressed in.
    """
    chains = _Chains.of(states)
    here = now = states
    held = _held(edges, states.shape[1])
    grip = params.grip * held.astype(np.float64)
    actions, wanted = Actions(edges, moves[:, :2], moves[:, 2]), np.zeros(states.shape)
    pace = np.hypot(moves[:, :1], moves[:, 1:2]) / params.steps * np.ones(held.shape)
    way = []
    contact = None if contact_of is None else contact_of(states)
    for k in range(1, params.steps + 1):
        wanted[held] = gripped(states, actions, k / params.steps).reshape(-1, 2)
        for _ in range(params.rounds):
            now = _relaxed(
                chains, now, here, ropes, _weight(pace, params.slip_m), grip, wanted, contact
            )
            pace = np.hypot(*np.moveaxis(now - here, -1, 0))
        here = now
        way.append(now)
    at_last = None if contact_of is None else contact_of(here)
    return np.stack([*way, _released(chains, here, pace, ropes, params, at_last)], 1)


def left_alone(states: FloatArray, ropes: Sliders) -> FloatArray:
    """(B, n, 2) states to those at which the DLO comes to rest when nobody holds it."""
    params = SlidingParams(released=40)
    return _released(
        _Chains.of(states), states, np.full(states.shape[:2], params.slip_m), ropes, params
    )


def _released(
    chains: _Chains,
    before: FloatArray,
    pace: FloatArray,
    ropes: Sliders,
    params: SlidingParams,
    contact: Contact | None = None,
) -> FloatArray:
    now, free = before, np.zeros(pace.shape)
    for _ in range(params.released):
        now = _relaxed(
            chains, now, before, ropes, _weight(pace, params.slip_m), free, before, contact
        )
        pace = np.hypot(*np.moveaxis(now - before, -1, 0))
    return now


def _weight(pace: FloatArray, slip_m: float) -> FloatArray:
    """(B, n) Coulomb friction over displacement; an end node carries half of an edge."""
    friction = np.ones(pace.shape[1])
    friction[[0, -1]] = 0.5
    return friction / np.sqrt(pace**2 + slip_m**2)


def _held(edges: IntArray, nodes: int) -> NDArray[np.bool_]:
    """(B, n) the two nodes of each gripped edge."""
    numbers = np.arange(nodes)
    return (numbers == edges[:, None]) | (numbers == edges[:, None] + 1)


def _relaxed(
    chains: _Chains,
    nodes: FloatArray,
    before: FloatArray,
    ropes: Sliders,
    weight: FloatArray,
    grip: FloatArray,
    wanted: FloatArray,
    contact: Contact | None,
) -> FloatArray:
    """The nodes after one step of reweighted least squares from ``nodes`` towards the shape of
    least energy; the chains change in place."""
    both = weight + grip
    force = both[..., None] * nodes - weight[..., None] * before - grip[..., None] * wanted
    beyond, weights = (np.cumsum(a[:, ::-1], 1)[:, ::-1] for a in (force, both))
    normal = np.empty((*chains.heading.shape, 2))
    normal[..., 0] = -chains.length * np.sin(chains.heading)
    normal[..., 1] = chains.length * np.cos(chains.heading)
    bend = ropes.stiffness[:, None] * (chains.heading[:, 1:] - chains.heading[:, :-1] - ropes.rest)
    right = np.empty((len(nodes), nodes.shape[1] + 1))
    right[:, :2] = -beyond[:, 0]
    right[:, 2:] = -(normal * beyond[:, 1:]).sum(-1)
    right[:, 3:] -= bend
    right[:, 2:-1] += bend
    system = _system(normal, weights, ropes.stiffness)
    if contact is not None:
        add_rows(contact(nodes), normal, right, system)
    step = np.linalg.solve(system, right[..., None])[..., 0]
    chains.first += step[:, :2]
    chains.heading += np.clip(step[:, 2:], -0.5, 0.5)
    return chains.nodes()


def _system(normal: FloatArray, weights: FloatArray, stiffness: FloatArray) -> FloatArray:
    """(B, n + 1, n + 1): second derivatives by the first node's place and the headings.

    ``weights`` (B, n): of all nodes from each on, since a heading moves all nodes behind its edge.
    """
    batch, count, _ = normal.shape
    later, bending = _constant(count)
    leverage = normal * weights[:, 1:, None]
    x, y = normal[..., 0], normal[..., 1]
    system = np.empty((batch, count + 2, count + 2))
    system[:, :2, :2] = weights[:, :1, None] * np.eye(2)
    system[:, :2, 2:] = leverage.transpose(0, 2, 1)
    system[:, 2:, :2] = leverage
    angles = system[:, 2:, 2:]
    np.multiply(x[:, :, None], x[:, None], out=angles)
    angles += y[:, :, None] * y[:, None]
    angles *= weights[:, 1:].take(later, axis=1)
    angles += stiffness[:, None, None] * bending
    return system


@cache
def _constant(count: int) -> tuple[IntArray, FloatArray]:
    """(count, count): the later of two edges, and second derivatives of half the sum of squared
    bends."""
    k = np.arange(count)
    joints = np.diff(np.eye(count), axis=0)
    return np.maximum(k[:, None], k), joints.T @ joints
