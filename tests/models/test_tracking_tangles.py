"""Cables in contact keep their ids: they sweep over one another, and pictures join what does not
belong together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.tracking.consistency import contradicting
from models.tracking.motion import moved
from models.tracking.ownership import Run, entering, sample
from models.tracking.placing import Piece
from models.tracking.regrouping import cuts
from models.tracking.state import NODES, Observation, Track, TrackedCable
from models.tracking.track import follow, observe
from tests.models.test_tracking import WIDTH, instance, scene, wave


def upright(x: float, bend: float = 20.0) -> np.ndarray:
    """A cable from top to bottom about column ``x``."""
    y = np.linspace(40, 360, 200)
    return np.column_stack([x + bend * np.sin(y / 70), y])


@pytest.mark.slow
@pytest.mark.parametrize("speed", [2.0, 3.0, 5.0])
def test_a_cable_that_sweeps_over_another_one_goes_on(speed: float) -> None:
    """For some frames both are one strand."""
    track = Track()
    for t in range(int(200 / speed)):
        moving, still = upright(220 + speed * t), upright(320)
        apart = abs(220 + speed * t - 320)
        shown = (
            [instance(moving), instance(still)]
            if apart > WIDTH
            else [instance(0.5 * (moving + still))]
        )
        track = follow(track, scene(*shown))
    places = {cable.id: float(cable.xy[:, 0].mean()) for cable in track.cables}
    assert set(places) == {1, 2}
    assert places[1] == pytest.approx(float(moving[:, 0].mean()), abs=WIDTH)
    assert places[2] == pytest.approx(float(still[:, 0].mean()), abs=WIDTH)


def only(track: Track) -> TrackedCable:
    (cable,) = track.cables
    return cable


def met() -> tuple[TrackedCable, Observation]:
    shown = scene(instance(wave(200)))
    return only(follow(Track(), shown)), observe(shown, None, None)[0]


def piece(observed: Observation, first: float, last: float) -> Piece:
    place = np.linspace(first, last, 20)
    return Piece(
        observed, np.column_stack([place, np.full(20, 200.0)]), place, 0.1, 0.9, False, np.ones(20)
    )


def test_a_piece_beyond_both_ends_shows_no_node() -> None:
    """A match whose pieces lie between no nodes ended the frame with an error of NumPy."""
    cable, observed = met()
    after = moved(
        cable, cable.xy, cable.xy, [piece(observed, cable.length_px + 90, cable.length_px + 120)]
    )
    assert not after.seen.any()
    assert np.isfinite(after.xy).all()


def test_of_pieces_at_one_place_the_likelier_one_stays() -> None:
    """Under an arm a picture joined half of a cable to another one; the unlikely piece drove out
    the right one."""
    cable, observed = met()
    pieces = {7: piece(observed, 0, 300), 8: piece(observed, 50, 200)}
    assert contradicting(pieces, cable, {7: -20.0, 8: 90.0}) == [7]
    assert contradicting(pieces, cable, {7: 90.0, 8: 20.0}) == [8]


def test_a_place_that_was_out_of_view_is_no_reason_to_leave_a_strand_that_goes_straight_on() -> (
    None
):
    """The tail of a cable came in across the supposed place of another one, hidden one, and was
    given to that."""
    cable, observed = met()
    half = np.arange(NODES) < NODES // 2
    cable = replace(cable, seen=half)
    samples = sample([replace(observed, crossings=(0.25, 0.75))])
    places = np.linspace(0, cable.length_px, len(samples.xy))[:, None]
    cost = entering(samples, [cable], places)
    at = [int(np.abs(samples.along - u * observed.length_px).argmin()) for u in (0.25, 0.75)]
    assert samples.loose[at].all()
    assert cost[at[1], 0] > cost[at[0], 0] + 10
    assert cost[at[0], 0] == cost[at[0], 1] == cost[at[1], 1]
    assert (cost[~samples.loose] > 1e3).all()


def test_cables_met_with_wrong_halves_keep_the_ids_that_most_of_them_had() -> None:
    """The longer half where pictures joined two cables decided: one took the strand of the other
    one, which was longer elsewhere, and what it had been on got a new id."""
    short, long = (
        replace(met()[0], id=k, length_px=length, ends=("free", "free"), firm=np.zeros(NODES))
        for k, length in ((1, 110.0), (2, 290.0))
    )
    observed = replace(met()[1], length_px=200.0)
    other = replace(observed, number=2)
    found = [
        strand(observed, 0, 0.0, 60.0),
        strand(observed, 1, 60.0, 200.0),
        strand(other, 1, 0.0, 150.0),
    ]
    found.append(strand(other, 0, 150.0, 200.0))
    own = {
        0: {0: piece(observed, 0, 60), 3: piece(other, 60, 110)},
        1: {1: piece(observed, 150, 290), 2: piece(other, 0, 150)},
    }
    assert cuts(found, own, [short, long])[0] == {0: (0.0, 60.0), 1: (0.0, 150.0)}


def strand(observed: Observation, cable: int, first: float, last: float) -> Run:
    """Of a strand that is alone."""
    along = np.linspace(first, last, 20)
    xy, ones = np.column_stack([along, np.full(20, 200.0)]), np.ones(20)
    return Run(cable, observed, 0, 20, along, xy, along, np.zeros((20, 3)), ones, False)


def test_two_cables_on_one_strand_become_the_older_one() -> None:
    """Each was known to go on, out of view, where the other one was: they shared the strand for
    ever, and which of both it was alternated."""
    whole, observed = met()
    half = 0.5 * whole.length_px
    older = replace(whole, met=90, joined=6)
    newer = replace(whole, id=2, met=20, joined=6)
    found = [strand(observed, 0, 0.0, half), strand(observed, 1, half, whole.length_px)]
    own = {0: {0: piece(observed, 0.0, half)}, 1: {1: piece(observed, half, whole.length_px)}}
    assert cuts(found, own, [older, newer]) == ({0: (0.0, half), 1: None}, {0, 1})
    assert cuts(found, own, [replace(older, joined=5), newer]) == ({}, {0, 1})
    elsewhere = {0: own[0] | {2: piece(observed, half + 40, whole.length_px)}, 1: own[1]}
    assert cuts(found, elsewhere, [older, newer]) == ({}, {0, 1})


def test_pictures_that_go_on_to_contradict_the_track_are_right_at_last() -> None:
    """Two cables that had exchanged their tails in a tangle kept them for ever: each had been seen
    alone since. Each stays where its end was confirmed before that."""
    whole, observed = met()
    observed, other = (
        replace(observed, length_px=200.0),
        replace(observed, length_px=200.0, number=2),
    )
    exchanged = [
        replace(whole, id=k, length_px=200.0, joined=12, doubted=doubted)
        for k, doubted in ((1, (-50, -5)), (2, (-60, -60)))
    ]
    found = [strand(observed, 0, 0.0, 80.0), strand(observed, 1, 80.0, 200.0)]
    found += [strand(other, 1, 0.0, 80.0), strand(other, 0, 80.0, 200.0)]
    own = {
        0: {0: piece(observed, 0, 80), 3: piece(other, 80, 200)},
        1: {1: piece(observed, 80, 200), 2: piece(other, 0, 80)},
    }
    assert cuts(found, own, exchanged) == ({0: (0.0, 80.0), 1: (0.0, 80.0)}, {0, 1})
    assert cuts(found, own, [replace(cable, joined=11) for cable in exchanged]) == ({}, {0, 1})
