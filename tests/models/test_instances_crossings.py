"""Crossings of centerlines: found once, with positions, and ordered by color."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.polylines import resample
from models.instances.crossings import Strand, find_meetings, order_meeting
from tests.models.drawn_masks import colored, loop


def strand(points, width: float = 10.0) -> Strand:
    return Strand.of(resample(np.array(points, float), 60), width)


ACROSS = [[20, 120], [300, 120]]
DOWN = [[160, 20], [160, 220]]


def test_one_crossing_of_two_lines():
    (meeting,) = find_meetings([strand(ACROSS), strand(DOWN)])
    assert (meeting.a, meeting.b) == (0, 1)
    assert (meeting.at_a, meeting.at_b) == pytest.approx((140, 100))
    assert meeting.xy.tolist() == pytest.approx([160, 120])
    assert meeting.sine == pytest.approx(1)


def test_no_strands_no_meetings():
    assert find_meetings([]) == []


@pytest.mark.parametrize(("wiggles", "expected"), [(2, 0), (3, 1)])
def test_centerlines_that_weave_count_by_parity(wiggles, expected):
    """Strands that share a stretch intersect a few times by noise: even is a touch, odd one
    crossing."""
    xs = 150 + 5.0 * np.arange(wiggles + 1)
    weave = [
        [20, 100],
        *[[x, 120 + (2 if k % 2 else -2)] for k, x in enumerate(xs)],
        [300, 100 if wiggles % 2 == 0 else 140],
    ]
    polyline = Strand.of(np.array(weave, float), 10.0)
    assert len(find_meetings([strand(ACROSS), polyline])) == expected


def test_self_crossing_has_two_positions_on_one_strand():
    (meeting,) = find_meetings([Strand.of(resample(loop(), 120), 10.0)])
    assert (meeting.a, meeting.b) == (0, 0)
    assert meeting.at_b - meeting.at_a > 250


def test_curl_tighter_than_a_cable_bends_is_no_crossing():
    curl = [[20, 120], [160, 120], [165, 115], [160, 112], [158, 125], [300, 125]]
    assert find_meetings([Strand.of(np.array(curl, float), 10.0)]) == []


@pytest.mark.parametrize("top", [0, 1])
def test_even_color_lies_on_top(top):
    lines = [ACROSS, DOWN]
    colors = [(220, 200, 30), (20, 120, 60)]
    order = [1 - top, top]
    image = colored(*[(np.array(lines[k], float), colors[k]) for k in order])
    strands = [strand(line) for line in lines]
    (meeting,) = find_meetings(strands)
    crossing = order_meeting(meeting, strands, image)
    assert crossing.over.instance == top + 1
    assert crossing.under.instance == 2 - top
    assert crossing.score > 0.95


def test_equal_colors_leave_the_order_open():
    image = colored((np.array(ACROSS, float), (90, 90, 90)), (np.array(DOWN, float), (90, 90, 90)))
    strands = [strand(ACROSS), strand(DOWN)]
    (meeting,) = find_meetings(strands)
    assert order_meeting(meeting, strands, image).score == pytest.approx(0.5)
    assert order_meeting(meeting, strands, None).score == 0.5


def test_seam_of_a_ring_is_no_crossing():
    """The last point of a ring is its first; what happens around it is one place, not two ends of a
    strand."""
    seam = [
        [100, 100],
        [106, 101],
        [200, 100],
        [200, 200],
        [100, 200],
        [100, 110],
        [102, 98],
        [100, 100],
    ]
    assert find_meetings([Strand.of(np.array(seam, float), 10.0)]) == []
