"""How much one plan looks at, counted, not timed."""

from __future__ import annotations

import numpy as np
import pytest

from models.disentangling import plan as planner
from models.disentangling import turn_candidates
from models.disentangling.hands import in_hands
from models.disentangling.rigid_piece import Pivot, body_of, turned
from models.disentangling.sweep import Sweep
from models.geometry.polylines import intersections, segments
from models.topology.scene import Crossing, Place, Topology
from tests.models.harnesses import crossed, section, topology


def grid(rows: int) -> Topology:
    """Cables across cables: rows squared crossings."""
    long = 40.0 * rows
    at = [40.0 * k + 20 for k in range(rows)]
    lines = [section([(0, y), (long, y)]) for y in at] + [section([(x, 0), (x, long)]) for x in at]
    crossings = [
        Crossing((x, y), Place(j, x / long), Place(rows + i, y / long), 1.0, 1.0)
        for i, x in enumerate(at)
        for j, y in enumerate(at)
    ]
    return topology(lines, crossings=crossings)


def test_only_segments_that_a_turn_can_bring_together_are_looked_at():
    """Every pair of segments was tried at each of 71 angles: 112 million for a harness of five
    sections."""
    scene = in_hands(crossed(), 12.0)
    body = body_of(scene, Pivot(2, 0.0, 1, 0))
    assert body is not None
    sweep = Sweep(scene, body)
    starts, ends, _ = segments(body.moving)
    rest_starts, rest_ends, _ = segments(body.resting)
    assert 0 < sweep.pairs < 0.5 * len(starts) * len(rest_starts)
    for angle in np.linspace(-3, 3, 41).tolist():
        moved = turned(starts, body.center, angle), turned(ends, body.center, angle)
        _, _, every = intersections(moved, (rest_starts, rest_ends))
        found = [xy for _, _, xy in sweep.crossings(angle)]
        clear = every[np.hypot(*(every - body.center).T) > 2.0]
        assert len(found) >= len(clear)
        assert all(np.isclose(every, xy).all(1).any() for xy in found)


@pytest.mark.slow
def test_a_plan_looks_at_a_limited_number_of_places_and_segments(monkeypatch):
    """With more crossings, and with finer pictures of longer cables, a plan took as long as it
    took: 18 s."""
    looked = []
    turns_about = turn_candidates._turns_about

    def counted(scene, held, *rest):
        looked.append(Sweep(scene, held.body).pairs)
        return turns_about(scene, held, *rest)

    monkeypatch.setattr(turn_candidates, "_turns_about", counted)
    monkeypatch.setattr(planner, "_MOST_HOLDS_IN_ALL", 60)
    found = planner.plan(
        grid(5), lambda rows: np.full(len(rows), 0.2), planner.DisentangleParams(hand_px=6.0)
    )
    assert found
    assert len(looked) == 60
    # A cable ten times as long in hands has no more points to be swept.
    long = in_hands(
        topology([section([(0, 0), (4e4, 10)]), section([(2e4, -2e4), (2e4, 2e4)])]), 6.0
    )
    body = body_of(long, Pivot(0, long.sections[0].length / 2, 1, -1))
    assert body is not None
    assert sum(len(xy) for _, xy in body.moving + body.resting) <= 3 * 150
