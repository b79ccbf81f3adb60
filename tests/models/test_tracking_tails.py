"""Tails that went out of view: where they are supposed to be, and the strands that turn out to be
they."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from models.geometry.polylines import resample
from models.instances.scene import Instance
from models.tracking.course import laid_on
from models.tracking.ownership import Run
from models.tracking.regrouping import cuts
from models.tracking.state import NODES
from tests.models.test_tracking import WIDTH, instance, run, scene, wave
from tests.models.test_tracking_tangles import met, piece, strand


def turned(t: float) -> np.ndarray:
    """A cable of which the right half turns about the middle by ``t`` rad, smoothly."""
    line = wave(200)
    steps = np.diff(line, axis=0)
    angle = np.arctan2(steps[:, 1], steps[:, 0]) + t / (
        1 + np.exp(-(np.arange(len(steps)) - 100) / 12)
    )
    ways = np.hypot(*steps.T)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return np.concatenate([line[:1], line[:1] + np.cumsum(ways, axis=0)])


def left_half(line: np.ndarray) -> Instance:
    return instance(line[:90], ("free", "hidden"))


def test_a_tail_out_of_view_stays_where_it_was() -> None:
    """What was in view bent a little on its way into a tangle; the tail was bent on and on by that,
    and swung away from its cable by a right angle in some ten frames."""
    cable = run([scene(instance(wave(200)))] * 20)[-1].cables[0]
    seen, xy = np.arange(NODES) < NODES // 2, cable.xy.copy()
    xy[seen, 1] -= 0.15 * np.maximum(np.arange(24.0) - 12, 0) ** 2
    xy[~seen] += xy[23] - cable.xy[23]
    places = []
    for _ in range(10):
        xy, course = laid_on(cable, xy, seen)
        cable = replace(cable, xy=xy, course=course)
        places.append(xy[-1])
    assert np.hypot(*(places[-1] - places[0])) < 0.5 * WIDTH


def test_a_strand_that_comes_out_where_a_tail_went_in_is_the_tail() -> None:
    """It came out elsewhere than it was supposed to: it became a new cable, and its own had no tail
    for ever."""
    whole, moved = turned(0.0), turned(0.5)
    frames = [scene(instance(whole))] * 10 + [scene(left_half(whole))] * 12
    # As long as what is missing may be under an arm, a track waits; then the picture is as usual.
    frames += [scene(left_half(moved), instance(moved[115:], ("hidden", "free")))] * 20
    cables = run(frames)[-1].cables
    assert [cable.id for cable in cables] == [1]
    assert np.abs(cables[0].xy - resample(moved, NODES)).max() < 2 * WIDTH


@pytest.mark.parametrize("line", [turned(-0.5)[115:] + np.array([0.0, -150.0]), wave(320)])
def test_a_strand_that_is_no_tail_is_a_new_cable(line: np.ndarray) -> None:
    """Too far from where the tail went in, or longer than it."""
    whole = turned(0.0)
    frames = [scene(instance(whole))] * 10 + [scene(left_half(whole))] * 12
    frames += [scene(left_half(whole), instance(line))] * 3
    assert [cable.id for cable in run(frames)[-1].cables] == [1, 2]


def test_cables_that_are_long_known_do_not_become_one() -> None:
    """Two ends met at the border for six frames; the two cables became one."""
    whole, observed = met()
    half = 0.5 * whole.length_px
    found = [strand(observed, 0, 0.0, half), strand(observed, 1, half, whole.length_px)]
    own = {0: {0: piece(observed, 0.0, half)}, 1: {1: piece(observed, half, whole.length_px)}}
    older = replace(whole, met=200, joined=6)
    assert cuts(found, own, [older, replace(whole, id=2, met=99, joined=6)])[0] == {
        0: (0.0, half),
        1: None,
    }
    assert cuts(found, own, [older, replace(whole, id=2, met=100, joined=6)])[0] == {}


def test_strands_that_meet_in_a_corner_are_not_joined() -> None:
    """At the edge of an arm a picture joined two cables for as long as the arm was there, and was
    believed."""
    whole, observed = met()
    cables = [replace(whole, id=k, length_px=200.0, joined=12) for k in (1, 2)]
    found = [strand(observed, 0, 0.0, 80.0), strand(observed, 1, 80.0, 200.0)]
    own = {0: {0: piece(observed, 0, 80)}, 1: {1: piece(observed, 80, 200)}}
    assert cuts(found, own, cables)[1] == {0, 1}
    found[1] = upward(found[1])
    assert cuts(found, own, cables) == ({}, set())


def upward(found: Run) -> Run:
    """The same strand, turned by a right angle about its beginning."""
    away = found.xy - found.xy[0]
    return found._replace(xy=found.xy[0] + np.column_stack([-away[:, 1], away[:, 0]]))
