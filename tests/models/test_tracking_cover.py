"""What an arm over the cables hides, and what a track learns of it while it is there."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.polylines import resample
from models.instances.scene import Instance, Scene
from models.tracking.state import NODES, Track
from tests.models.test_tracking import instance, run, scene, wave

ROWS = 120.0, 180.0, 240.0
LEFT, RIGHT = slice(0, 60), slice(140, 200)
"""What an arm over the middle leaves in view."""


def parts(rows: tuple[float, ...] = ROWS) -> list[Instance]:
    """What a picture shows of cables beside an arm: strands that seem to end in the open."""
    return [instance(wave(row)[side]) for row in rows for side in (LEFT, RIGHT)]


def joined(first: float, second: float) -> Instance:
    """A cable on the left of the arm that the picture goes on with as another one on its right."""
    return instance(np.concatenate([wave(first)[LEFT], wave(second)[RIGHT]]))


def whole() -> Scene:
    return scene(*(instance(wave(row)) for row in ROWS))


def covered_then(frames: int) -> list[Track]:
    return run([whole()] * 20 + [scene(*parts())] * frames + [whole()])


def test_an_arm_is_noticed_and_its_end_too() -> None:
    tracks = covered_then(5)
    assert [track.cover.covered for track in tracks[18:]] == [False, False, *[True] * 5, False]


@pytest.mark.slow
def test_ends_at_the_edge_of_an_arm_are_no_ends() -> None:
    """Cables were cut, or new ones begun, where the arm lay for long."""
    *_, before, after = covered_then(80)
    for track in (before, after):
        assert [cable.id for cable in track.cables] == [1, 2, 3]
        assert [cable.ends for cable in track.cables] == [("free", "free")] * 3
    for cable, row in zip(after.cables, ROWS, strict=True):
        assert np.abs(cable.xy - resample(wave(row), NODES)).max() < 3


def test_a_picture_that_joins_cables_under_an_arm_is_not_believed() -> None:
    """Two cables that were met a moment ago are not firmly known: the picture was believed, and one
    of them cut."""
    frames = [scene(joined(*ROWS[:2]), *parts(ROWS[2:]), *parts()[1:3])] * 30
    after = run([whole()] * 5 + frames + [whole()])[-1]
    assert [(cable.id, cable.state) for cable in after.cables] == [(k, "seen") for k in (1, 2, 3)]
    rows = [float(cable.xy[:, 1].mean()) for cable in after.cables]
    assert rows == pytest.approx([wave(row)[:, 1].mean() for row in ROWS], abs=5)


def test_a_cable_that_is_taken_away_is_no_arm() -> None:
    """The others are whole."""
    two = scene(*(instance(wave(row)) for row in ROWS[:2]))
    track = run([whole()] * 20 + [two])[-1]
    assert (track.cover.covered, [cable.state for cable in track.cables]) == (
        False,
        ["seen", "seen", "lost"],
    )


def test_a_cable_far_from_all_others_is_new_beside_an_arm() -> None:
    frames = [whole()] * 20 + [scene(*parts())] * 3 + [scene(*parts(), instance(wave(370.0)[:100]))]
    track = run(frames)[-1]
    assert track.cover.covered
    assert {cable.id: cable.state for cable in track.cables}[4] == "new"


def test_cables_that_leave_the_picture_are_no_arm() -> None:
    frames = []
    for t in range(30):
        lines = [wave(row, dx=-16.0 * t) for row in ROWS]
        inside = [line[line[:, 0] >= 0] for line in lines]
        frames.append(
            scene(*(instance(line, ("border" if t > 3 else "free", "free")) for line in inside))
        )
    assert not any(track.cover.covered for track in run(frames))


@pytest.mark.slow
def test_an_arm_that_stays_is_the_usual_picture_at_last() -> None:
    tracks = run([whole()] * 20 + [scene(*parts())] * 300)
    assert not tracks[-1].cover.covered
