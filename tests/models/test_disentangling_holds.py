"""Where a gripper can hold one strand of a harness."""

from __future__ import annotations

import numpy as np
import pytest

from models.disentangling.hands import in_hands
from models.disentangling.hold_candidates import find_holds
from tests.models.harnesses import crossed


@pytest.mark.parametrize(("hand_px", "nearest_px"), [(6.0, 24.0), (12.0, 29.0), (24.0, 38.0)])
def test_a_strand_is_not_held_so_near_to_a_branch_point_that_this_would_be(hand_px, nearest_px):
    """2.5 widths of 8 px and three quarters of a hand."""
    scene = in_hands(crossed(), hand_px)
    holds = find_holds(scene)
    assert any(h.pivot.branch >= 0 for h in holds)
    for held in (h for h in holds if h.pivot.branch < 0):
        section = scene.sections[held.pivot.section]
        ends = [e for e, b in enumerate(section.branches) if b >= 0]
        away = [held.pivot.at if e == 0 else section.length - held.pivot.at for e in ends]
        assert min(away, default=np.inf) * hand_px >= nearest_px


def test_away_from_branch_points_a_strand_is_held_on_both_sides_of_what_it_crosses():
    holds = [h for h in find_holds(in_hands(crossed(), 6.0)) if h.pivot.branch < 0]
    assert {h.pivot.side for h in holds} == {1, -1}
