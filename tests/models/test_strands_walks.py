"""Following the partners of section ends, on partners written by hand."""

from __future__ import annotations

import numpy as np

from models.strands.walks import follow


def test_sections_are_entered_in_order_and_rings_are_known():
    """Three sections in a string (ends 0 to 5), the middle one backwards, and two in a ring (6 to
    9)."""
    partner = np.array([0, 3, 4, 1, 2, 5, 9, 8, 7, 6])
    assert follow(partner) == [([0, 3, 4], False), ([6, 8], True)]


def test_sections_that_are_done_are_left_out():
    partner = np.array([0, 2, 1, 3])
    assert follow(partner, np.array([False, True])) == [([0], False)]
    assert follow(np.array([0, 1])) == [([0], False)]
    assert follow(np.array([1, 0])) == [([0], True)]
