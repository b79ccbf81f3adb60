"""Places keep their arc length along a cable, whichever of its ends are in view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.geometry.polylines import arc_lengths
from models.instances.scene import EndpointKind
from models.tracking.course import recognised
from models.tracking.ownership import sample
from models.tracking.placing import Piece
from models.tracking.registration import registered
from models.tracking.state import NODES, Track, TrackedCable
from models.tracking.track import follow, observe
from tests.models.test_tracking import WIDTH, instance, run, scene, wave

PICTURE_PX = 640


def place_at(cable: TrackedCable, arc_px: float) -> np.ndarray:
    """(2,) where the place of this arc length is."""
    along = cable.start_px + cable.length_px * np.linspace(0, 1, NODES)
    return np.array([np.interp(arc_px, along, axis) for axis in cable.xy.T])


@pytest.mark.slow
def test_an_end_that_is_not_there_does_not_move_the_places_of_a_cable() -> None:
    """A cable was met with a piece of another one at its end; the end of its own was taken for that
    one the sooner, the longer that was out of view, and all of its places slid along it by what it
    was too long."""
    line = wave(200)
    frames = [scene(instance(line))] * 45 + [scene(instance(line[20:], ("free", "border")))] * 60
    place = float(arc_lengths(line)[110])
    for track in run(frames):
        assert np.hypot(*(place_at(track.cables[0], place) - line[110])) < WIDTH
    assert track.cables[0].start_px == pytest.approx(float(arc_lengths(line)[20]), abs=WIDTH)


def straight(slid_px: float) -> tuple[np.ndarray, tuple[EndpointKind, EndpointKind]]:
    """What a picture shows of a straight cable of 900 px, and its ends; it has slid along
    itself."""
    x = np.arange(-300.0, 601.0) + slid_px
    inside = (x >= 0) & (x < PICTURE_PX)
    ends: tuple[EndpointKind, EndpointKind] = (
        "free" if inside[0] else "border",
        "free" if inside[-1] else "border",
    )
    return np.column_stack([x[inside], np.full(inside.sum(), 200.0)]), ends


def test_a_known_end_tells_where_a_cable_is_that_has_slid_along_itself_unseen() -> None:
    """Nothing shows how far a straight cable slides between two borders. Its other end came into
    view meanwhile, was taken for known, and the end that had been known before was given up for
    it."""
    track = Track()
    for t in range(120):
        line, ends = straight(200 * (1 - np.cos(2 * np.pi * max(t - 12, 0) / 107)))
        track = follow(track, scene(instance(line, ends)))
        if t == 0:
            arc_px = float(track.cables[0].start_px + np.hypot(*(line[400] - line[0])))
    (cable,) = track.cables
    assert cable.ends[1] == "free"
    assert np.hypot(*(place_at(cable, arc_px) - line[400])) < WIDTH


def test_a_cable_does_not_reach_beyond_an_end_of_it_that_is_known() -> None:
    """A strand between two borders was longer than the cable was known to be on that side: the end
    was moved."""
    cable = run([scene(instance(*straight(0.0)))] * 10)[-1].cables[0]
    slid = replace(cable, adrift_px=100.0)
    line, ends = straight(0.0)
    for known, wanted in ((slid, cable.length_px), (cable, cable.length_px + 60)):
        shown = scene(
            instance(line + np.array([60.0, 0.0]) * (line[:, :1] > 0), (ends[0], "border"))
        )
        after = follow(
            Track(1, (replace(known, velocity=np.zeros((NODES, 2))),), (), 2), shown
        ).cables[0]
        assert after.start_px + after.length_px <= wanted + WIDTH


def test_cables_laid_on_their_strands_together_and_one_by_one_are_the_same() -> None:
    tracks = run([scene(*(instance(wave(y, 0.02 * t)) for y in (100, 118, 300))) for t in range(8)])
    cables = tracks[-1].cables
    samples = sample(
        observe(scene(*(instance(wave(y, 0.16)) for y in (100, 118, 300))), None, None)
    )
    predicted = [cable.xy + cable.velocity for cable in cables]
    together = registered(cables, predicted, samples)
    for cable, xy, found in zip(cables, predicted, together, strict=True):
        (alone,) = registered([cable], [xy], samples)
        assert np.abs(found - alone).max() < 1e-9
        assert np.abs(found - xy).max() > 0


def test_a_cable_is_not_as_long_at_once_as_a_strand_that_a_picture_joined_to_another() -> None:
    """A cable grew by a hundredth a frame towards strands that ended where another cable does, and
    cuts corners: after some such frames its places had slid, and its length was that of no picture
    of it."""
    line = wave(200)
    step = (line[-1] - line[-2]) / np.hypot(*(line[-1] - line[-2]))
    longer = np.concatenate([line, line[-1] + step * np.arange(2.0, 22.0, 2.0)[:, None]])
    cable = run([scene(instance(line))] * 20 + [scene(instance(longer))] * 5)[-1].cables[0]
    whole = float(arc_lengths(line)[-1])
    assert cable.length_px < whole + 0.5 * (float(arc_lengths(longer)[-1]) - whole)


def test_the_course_moves_a_cable_along_itself_only_as_far_as_it_may_have_slid() -> None:
    """In a tangle, the course of what is seen is not the cable's alone: it moved cables by widths
    to and fro whose places had been known from their ends a frame ago."""
    x = np.linspace(60, 560, 200)
    line, shifted = (
        np.column_stack([x, 200 + 40 * np.sin((x - off) / 30)]) for off in (0.0, 1.5 * WIDTH)
    )
    known = run([scene(instance(line))] * 30)[-1].cables[0]
    shown = observe(scene(instance(shifted[20:-20], ("hidden", "hidden"))), None, None)[0]
    along = arc_lengths(shown.xy)
    piece = Piece(
        shown, shown.xy, along + arc_lengths(line)[20], 0.0, 1.0, False, np.ones(len(along))
    )
    moved = []
    for adrift_px in (0.0, 10 * WIDTH):
        cable = replace(known, adrift_px=adrift_px)
        moved.append(
            abs(float(recognised([piece], cable, known.xy)[0].position[0] - piece.position[0]))
        )
    assert moved[0] < 0.6 * moved[1]
