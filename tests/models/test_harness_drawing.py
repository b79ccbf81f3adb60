"""Naming the branches of a drawing on topologies drawn by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from models.topology.harness_drawing import Drawn, match_drawing
from tests.models.harnesses import section, topology

LENGTHS = {"main": 200.0, "long": 150.0, "short": 60.0, "stem": 90.0, "tail": 110.0}
DRAWING = [
    Drawn("main", "P", "Q", 100),
    Drawn("long", "P", "X1", 75),
    Drawn("short", "P", "X2", 30),
    Drawn("stem", "Q", "X3", 45),
    Drawn("tail", "Q", "X4", 55),
]


def harness(without: str = ""):
    """The drawing at two pixels a unit, its sections in another order."""
    made = {
        "tail": section([(300, 240), (300, 350)], (1, -1)),
        "main": section([(100, 240), (300, 240)], (0, 1)),
        "short": section([(100, 240), (100, 300)], (0, -1)),
        "stem": section([(300, 240), (390, 240)], (1, -1)),
        "long": section([(100, 240), (100, 90)], (0, -1)),
    }
    names = [n for n in made if n != without]
    return topology([made[n] for n in names], [(100, 240), (300, 240)]), names


def test_every_branch_is_named_and_the_scale_found():
    seen, names = harness()
    match = match_drawing(seen, DRAWING)
    assert {name: names[k] for name, (k,) in match.sections.items()} == {n: n for n in LENGTHS}
    assert match.scale == pytest.approx(2.0, rel=0.03)
    assert match.points["P"] == 0
    assert match.points["Q"] == 1
    assert not match.missing
    assert not match.extra
    assert match.cost < 0.05
    assert not match.ambiguous


def test_a_missing_branch_is_named():
    seen, names = harness(without="short")
    match = match_drawing(seen, DRAWING)
    assert match.missing == ("short",)
    assert {name: names[k] for name, (k,) in match.sections.items()} == {
        n: n for n in LENGTHS if n != "short"
    }


def test_an_extra_section_is_pointed_out():
    seen, _ = harness()
    more = topology([*seen.sections, section([(500, 400), (600, 400)])], [(100, 240), (300, 240)])
    assert match_drawing(more, DRAWING).extra == (5,)


def test_a_clip_that_cuts_a_branch_in_two_is_seen_through():
    """The drawing knows that there is no branch-point: both halves of the main branch carry its
    name."""
    seen, _ = harness()
    tail, _, short, stem, long = seen.sections
    halves = [section([(100, 240), (180, 240)], (0, 2)), section([(180, 240), (300, 240)], (2, 1))]
    clip = section([(180, 240), (180, 215)], (2, -1))
    cut = topology([tail, *halves, short, stem, long, clip], [(100, 240), (300, 240), (180, 240)])
    match = match_drawing(cut, DRAWING)
    assert sorted(match.sections["main"]) == [1, 2]
    assert match.extra == (6,)
    assert not match.missing


def test_a_given_scale_is_kept():
    seen, _ = harness()
    match = match_drawing(seen, DRAWING, scale=4.0)
    assert match.scale == 4.0
    assert match.cost > 0.5


def test_equal_lengths_are_reported_as_ambiguous():
    twins = [replace(b, length=50.0) if b.name in ("stem", "tail") else b for b in DRAWING]
    seen, _ = harness()
    same = topology(
        [
            section([(300, 240), (300, 340)], (1, -1)),
            *seen.sections[1:3],
            section([(300, 240), (400, 240)], (1, -1)),
            seen.sections[4],
        ],
        [(100, 240), (300, 240)],
    )
    assert match_drawing(same, twins).ambiguous


def test_connectors_tell_twins_apart():
    twins = [replace(b, length=50.0) if b.name in ("stem", "tail") else b for b in DRAWING]
    seen, _ = harness()
    plain = section([(300, 240), (300, 340)], (1, -1))
    plugged = replace(section([(300, 240), (400, 240)], (1, -1)), end_widths=(8.0, 20.0))
    same = topology(
        [plain, *seen.sections[1:3], plugged, seen.sections[4]], [(100, 240), (300, 240)]
    )
    match = match_drawing(same, twins, connectors=["X3"])
    assert match.sections["stem"] == (3,)
    assert match.sections["tail"] == (0,)


def test_nothing_seen_means_everything_missing():
    match = match_drawing(topology([]), DRAWING)
    assert len(match.missing) == 5
    assert match.scale is None
