"""Topologies drawn by hand, for tests of what is computed from them; and the networks that find
them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.geometry.polylines import arc_lengths, resample
from models.topology.classifiers import Classifiers
from models.topology.evidence import classifiers_of
from models.topology.scene import BranchPoint, Crossing, Place, Section, Topology
from models.weights.inference import Network, Runtime, default_name, load

HAND_PX = 12.0
"""Of the hand-drawn strands: the room that a gripper needs."""
ANYWHERE = 1e3
"""A margin, px: the piece may end anywhere."""


def always(probability: float):
    """A classifier that gives the same for every turn."""
    return lambda rows: np.full(len(rows), probability)


def shipped() -> tuple[Network, Classifiers]:
    """The networks that find a topology."""
    runtime = Runtime(threads=1)
    return load(default_name("topology"), runtime), classifiers_of(
        lambda task: load(default_name(task), runtime)
    )


def section(
    points: list[tuple[float, float]], branches: tuple[int, int] = (-1, -1), width: float = 8.0
) -> Section:
    rough = np.array(points, dtype=np.float64)
    line = resample(rough, max(2, round(float(arc_lengths(rough)[-1]) / 4)))
    ends = tuple("branch" if b >= 0 else "free" for b in branches)
    return Section(line, width, float(arc_lengths(line)[-1]), ends, branches)


def topology(
    sections: list[Section],
    branches: list[tuple[float, float]] = (),
    crossings: list[Crossing] = (),
    size: tuple[int, int] = (480, 640),
) -> Topology:
    points = tuple(
        BranchPoint(xy, tuple(k for k, s in enumerate(sections) for b in s.branches if b == i), 1.0)
        for i, xy in enumerate(branches)
    )
    none = np.zeros(0)
    return Topology(
        size,
        "branched" if branches else "plain",
        tuple(sections),
        points,
        tuple(crossings),
        np.zeros((0, 2)),
        none,
        np.zeros((0, 2)),
        np.zeros((0, 2), np.int64),
        none,
    )


def crossed(order_score: float = 1.0) -> Topology:
    """A trunk along y = 240 with a branch at x = 200 that comes back over it near (420, 240)."""
    trunk_left = section([(60, 240), (200, 240)], (-1, 0), 16)
    trunk_right = section([(200, 240), (560, 240)], (0, -1), 16)
    branch = section(
        [(200, 240), (210, 330), (320, 360), (400, 290), (440, 190), (450, 140)], (0, -1)
    )
    at = branch.xy[
        np.abs(branch.xy[:, 1] - 240)[len(branch.xy) // 2 :].argmin() + len(branch.xy) // 2
    ]
    u = float(arc_lengths(branch.xy)[np.hypot(*(branch.xy - at).T).argmin()]) / branch.length
    crossing = Crossing(
        (float(at[0]), 240.0), Place(2, u), Place(1, float((at[0] - 200) / 360)), 1.0, order_score
    )
    return topology([trunk_left, trunk_right, branch], [(200, 240)], [crossing])


def twice_crossed() -> Topology:
    """A cable that lies over two others."""
    over = section([(60, 240), (560, 240)])
    rest = [section([(x, 100), (x, 400)]) for x in (200.0, 420.0)]
    places = [Place(0, 140 / 500), Place(0, 360 / 500)]
    crossings = [
        Crossing((x, 240.0), place, Place(k, 140 / 300), 1.0, 1.0)
        for k, x, place in zip((1, 2), (200.0, 420.0), places, strict=True)
    ]
    return topology([over, *rest], crossings=crossings)


def touching() -> Topology:
    """A branch that passes over the trunk; its end comes to touch it and is taken for a
    branch-point: a ring."""
    trunk = [
        section([(60, 240), (200, 240)], (-1, 0), 16),
        section([(200, 240), (480, 240)], (0, 1), 16),
        section([(480, 240), (600, 240)], (1, -1), 16),
    ]
    branch = section(
        [(200, 240), (230, 330), (330, 330), (360, 240), (400, 150), (470, 170), (480, 240)], (0, 1)
    )
    at = float(arc_lengths(branch.xy)[np.hypot(*(branch.xy - (360, 240)).T).argmin()])
    crossing = Crossing((360.0, 240.0), Place(3, at / branch.length), Place(1, 160 / 280), 1.0, 1.0)
    harness = topology([*trunk, branch], [(200, 240), (480, 240)], [crossing])
    first, second = harness.branch_points
    return replace(harness, branch_points=(first, replace(second, score=0.9)))
