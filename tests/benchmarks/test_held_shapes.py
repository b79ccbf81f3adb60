"""Shapes that friction holds, of ropes whose answer is known."""

from __future__ import annotations

import pytest

from tests.benchmarks.bench_obstacles import scenes, straight
from tests.benchmarks.bench_planner import shape
from tests.benchmarks.held_shapes import nearest_held
from tests.benchmarks.ropes import ROPES


def test_a_limp_rope_keeps_every_shape_and_a_straight_one_is_always_kept():
    limp = nearest_held(ROPES[0], 0.9, 0.01, shape("S", ROPES[0].length))
    rod = nearest_held(ROPES[1], 0.4, 50.0, shape("I", ROPES[1].length))
    assert limp is not None
    assert rod is not None
    assert max(limp, rod) < 1e-3


@pytest.mark.slow
def test_a_stiff_rope_keeps_less_of_a_bend_than_a_soft_one():
    soft, stiff = (nearest_held(ROPES[1], 0.4, s, shape("U", ROPES[1].length)) for s in (1.0, 8.0))
    assert soft is not None
    assert stiff is not None
    assert soft < 0.01 < stiff


@pytest.mark.parametrize("scene", scenes(6, 3))
def test_pegs_stand_between_the_rope_and_its_target(scene):
    """Neither touches one, and one of the straight ways of the points goes through each."""
    start, gap = straight(scene.kind.length), scene.fixtures().gap
    for line in (start, scene.target):
        assert gap(line[:-1], line[1:]).min() > 0.01
    assert (gap(start, scene.target).min(0) < 0).all()
