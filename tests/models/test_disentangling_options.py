"""What options are worth: alone, in the scene that they leave, and beside one another."""

from __future__ import annotations

from dataclasses import replace

import pytest

from models.disentangling import plan as planner
from models.disentangling.hands import Frame, in_hands
from models.disentangling.plan import Option, Search
from models.disentangling.result_of_turn import after_turn
from models.disentangling.rigid_piece import Pivot
from models.topology.scene import Topology
from tests.models.harnesses import ANYWHERE, HAND_PX, always, crossed, twice_crossed


def search(harness: Topology, chance: float, margin_px: float = ANYWHERE) -> Search:
    """If every turn works with this probability."""
    return Search(always(chance), Frame.of(harness, HAND_PX, margin_px))


def options_of(harness: Topology, margin_px: float = ANYWHERE) -> list[Option]:
    """If every turn works in nine of ten cases."""
    return search(harness, 0.9, margin_px).options(in_hands(harness, HAND_PX), 1, 50)


def test_each_crossing_that_goes_is_worth_a_move_of_its_own():
    """At .9 each, two moves are worth .81; both crossings at once .9."""
    assert {round(o.chance, 6): o.turn.after for o in options_of(twice_crossed())} == {
        0.9: 0,
        0.81: 1,
    }


def test_a_piece_that_leaves_the_picture_is_worth_less_and_least_where_crossings_are_left():
    found = [o for o in options_of(twice_crossed(), 0.0) if o.turn.in_view < 0.9]
    left, done = (next(o for o in found if o.turn.after == n) for n in (1, 0))
    assert left.chance == pytest.approx(0.9**2 * left.turn.in_view**2)
    assert done.chance == pytest.approx(0.9 * done.turn.in_view)


def test_what_a_turn_leaves_counts_too():
    """With one crossing undone the other is still there to be undone: .9 times .9."""
    harness = twice_crossed()
    option = next(o for o in options_of(harness) if o.turn.after == 1)
    scene = in_hands(harness, HAND_PX)
    assert len(after_turn(scene, option.turn).crossings) == 1
    followed = search(harness, 0.9).with_what_follows(scene, option)
    assert followed.chance == pytest.approx(0.81)


def test_a_preparing_turn_is_proposed_where_no_other_is_likely():
    for chance, left in ((0.1, {0, 1}), (0.9, {0})):
        options = search(crossed(), chance).ranked(in_hands(crossed(), HAND_PX))
        assert {o.turn.after for o in options} == left


def test_where_all_chances_are_small_the_best_one_still_comes_first():
    """Chances below a fiftieth counted as equal: the smallest turn came first, whatever its
    score."""
    small, large = sorted(options_of(twice_crossed())[:2], key=lambda o: abs(o.turn.angle))
    places = [replace(small, chance=0.001), replace(large, chance=0.018)]
    turned_about = [
        replace(o, turn=replace(o.turn, held=replace(o.turn.held, pivot=Pivot(0, at, 1, -1))))
        for o, at in zip(places, (1.0, 2.0), strict=True)
    ]
    assert planner._preferred(turned_about)[0].chance == 0.018


def test_preparing_turns_are_looked_at_where_the_likely_ones_lead_nowhere(monkeypatch):
    """What would follow a likely turn was looked at, found to be hopeless, and chosen all the
    same."""
    scene = in_hands(crossed(), HAND_PX)
    looked_at = Search.with_what_follows

    def hopeless(self, before, option):
        found = looked_at(self, before, option)
        lost = before is scene and option.turn.after == 0
        return replace(found, chance=0.01) if lost else found

    monkeypatch.setattr(Search, "with_what_follows", hopeless)
    assert planner._preferred(search(crossed(), 0.9).ranked(scene))[0].turn.after == 1


def test_what_follows_a_preparing_turn_is_looked_at_as_deeply_as_what_follows_another():
    """One step less was looked at behind it, so that one preparing turn followed another."""
    scene = in_hands(twice_crossed(), HAND_PX)
    every = search(twice_crossed(), 0.9)
    prepares = next(o for o in every.options(scene, 0, 50) if o.turn.after == 2)
    with_one_left = [0.9, 0.9 * 0.9]
    followed = every.with_what_follows(scene, prepares).chance / (0.9 * planner._PREPARING)
    assert min(abs(followed - c) for c in with_one_left) < 1e-6
