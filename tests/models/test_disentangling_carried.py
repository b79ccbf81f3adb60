"""What an earlier picture showed is carried over an action, where the new picture agrees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.disentangling.carried import Done, carried, readings
from models.disentangling.rigid_piece import turned
from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths
from models.topology.scene import BranchPoint, Crossing, Place, Section, Topology
from tests.models.harnesses import crossed, section, topology

HELD = np.array([200.0, 240.0])
"""The branch-point of :func:`crossed`; its branch, section 2, is turned about it."""


def done(turn: float) -> Done:
    return Done((200.0, 240.0), tuple(crossed().sections[2].xy[25].tolist()), turn)


def with_branch_turned(turn: float, xy: FloatArray = HELD) -> Topology:
    """:func:`crossed` with the branch turned about a place; no crossing is left by 60 to 120
    degrees."""
    before = crossed()
    branch = before.sections[2]
    return topology(
        [*before.sections[:2], replace(branch, xy=turned(branch.xy, xy, turn))], [(200, 240)]
    )


def cropped(harness: Topology, lowest: float) -> Topology:
    """As a picture shows it that ends above ``lowest``."""

    def shown(s: Section) -> Section:
        xy = s.xy[s.xy[:, 1] < lowest]
        cut = len(xy) < len(s.xy)
        return replace(
            s,
            xy=xy,
            length=float(arc_lengths(xy)[-1]),
            ends=(s.ends[0], "border" if cut else s.ends[1]),
        )

    sections = tuple(map(shown, harness.sections))
    return replace(harness, sections=sections, size=(round(lowest), harness.size[1]))


def test_the_piece_lies_where_the_picture_shows_it_though_arms_erred():
    meant = np.deg2rad(75)
    seen = with_branch_turned(meant + np.deg2rad(7), HELD + np.array([0, 6]))
    known = carried(crossed(), done(meant), seen)
    assert known is not None
    assert known.crossings == ()
    for ours, theirs in zip(known.sections, seen.sections, strict=True):
        away = [np.hypot(*(theirs.xy - p).T).min() for p in ours.xy]
        assert np.mean(away) < 3
    assert [s.branches for s in known.sections] == [s.branches for s in crossed().sections]


def test_what_is_out_of_view_is_known_from_before():
    """A section that left the picture ended at its border, and nobody knew what lay beyond."""
    turn = np.deg2rad(75)
    whole = with_branch_turned(turn)
    seen = cropped(whole, 300.0)
    before = replace(crossed(), size=seen.size)
    assert seen.sections[2].length < 0.6 * whole.sections[2].length
    known = carried(before, done(turn), seen)
    assert known is not None
    assert known.sections[2].length == pytest.approx(whole.sections[2].length, rel=0.05)
    assert known.sections[2].ends == ("branch", "free")


def read_as_branches(score: float) -> Topology:
    """:func:`crossed`, its crossing read as a branch-point of such a score."""
    before = crossed()
    return replace(
        before,
        crossings=(),
        branch_points=(
            *before.branch_points,
            BranchPoint(before.crossings[0].xy, (1, 2), score),
        ),
    )


@pytest.mark.parametrize(("old", "new", "counts"), [(0.9, 0.7, 1), (0.7, 0.9, 0)])
def test_of_two_readings_of_a_joint_the_surer_one_counts(old, new, counts):
    before = crossed()
    before = replace(before, crossings=(replace(before.crossings[0], score=old),))
    nothing_moved = done(0.0)
    best = readings(before, nothing_moved, read_as_branches(new))[0]
    assert len(best.crossings) == counts
    if counts:
        assert 0.5 < best.crossings[0].score < old, "the new picture speaks against it"


def test_where_the_picture_shows_something_else_it_counts_alone():
    seen = with_branch_turned(np.deg2rad(75))
    elsewhere = replace(seen.sections[2], xy=seen.sections[2].xy + np.array([120, -20]))
    other = replace(seen, sections=(*seen.sections[:2], elsewhere))
    assert carried(crossed(), done(np.deg2rad(75)), other) is None
    assert readings(crossed(), done(np.deg2rad(75)), other) == [other]


def test_a_piece_that_did_not_move_is_where_it_was():
    known = carried(crossed(), done(np.deg2rad(75)), crossed())
    assert known is not None
    assert known.crossings[0].xy == pytest.approx(crossed().crossings[0].xy)


def test_a_piece_laid_over_a_strand_is_on_top_of_it():
    """Also where the picture does not show which is."""
    turn = np.deg2rad(-60)
    before = with_branch_turned(np.deg2rad(75))
    seen = crossed(order_score=0.5)
    moved = turned(before.sections[2].xy, HELD, np.deg2rad(-75))
    assert np.abs(moved - seen.sections[2].xy).max() < 1e-6
    pick = tuple(before.sections[2].xy[25].tolist())
    known = carried(before, Done((200.0, 240.0), pick, turn - np.deg2rad(15)), seen)
    assert known is not None
    assert [(c.over.section, c.under.section) for c in known.crossings] == [(2, 1)]
    assert known.crossings[0].order_score == 1.0


@pytest.mark.parametrize("end", [0, 1])
def test_a_section_that_comes_into_view_is_longer(end):
    """What left the picture at its border before ends where the new picture shows it."""
    whole = section([(320, 200), (320, 620)])
    rest = section([(60, 60), (600, 60)])
    cut = replace(section([(320, 200), (320, 479)]), ends=("free", "border"))
    if end == 0:
        cut = replace(cut, xy=cut.xy[::-1], ends=("border", "free"))
    middle = np.array([320.0, 280.0])
    before, turn = topology([cut, rest]), np.deg2rad(90)
    part = whole.xy[:, 1] > 280
    seen = topology(
        [
            replace(whole, xy=np.where(part[:, None], turned(whole.xy, middle, turn), whole.xy)),
            rest,
        ]
    )
    known = carried(before, Done((320.0, 280.0), (320.0, 400.0), turn), seen)
    assert known is not None
    assert known.sections[0].length == pytest.approx(420, rel=0.05)
    assert known.sections[0].ends == ("free", "free")


def test_an_empty_picture_says_nothing():
    nothing = topology([])
    assert carried(crossed(), done(1.0), nothing) is None
    assert carried(nothing, done(1.0), crossed()) is None


def test_crossings_keep_their_places_on_a_section_that_grows():
    line = replace(section([(100, 200), (100, 479)]), ends=("free", "border"))
    over = section([(60, 260), (200, 260)])
    at = Place(0, 60 / line.length)
    crossing = Crossing((100.0, 260.0), Place(1, 40 / 140), at, 1.0, 1.0)
    before = topology([line, over], crossings=[crossing])
    held = np.array([100.0, 330.0])
    whole = section([(100, 200), (100, 560)])
    part = whole.xy[:, 1] > 330
    turn = np.deg2rad(-90)
    seen = topology(
        [replace(whole, xy=np.where(part[:, None], turned(whole.xy, held, turn), whole.xy)), over],
        crossings=[replace(crossing, under=Place(0, 60 / 360))],
    )
    known = carried(before, Done((100.0, 330.0), (100.0, 420.0), turn), seen)
    assert known is not None
    assert known.crossings[0].under.u * known.sections[0].length == pytest.approx(60, abs=3)
