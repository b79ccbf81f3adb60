"""Cables keep their ids: they move, swap places, are covered, leave, come back and cross."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from models.geometry.polylines import arc_lengths, resample
from models.geometry.splines import Spline
from models.instances.scene import Crossing, Endpoint, EndpointKind, Instance, Scene, StrandPosition
from models.tracking.state import NODES, Track
from models.tracking.track import TrackParams, follow

WIDTH = 8.0
FREE: tuple[EndpointKind, EndpointKind] = ("free", "free")
SPLINE = Spline(degree=3, knots=np.zeros(0), control_xy=np.zeros((0, 2)))


def instance(
    xy: np.ndarray, ends: tuple[EndpointKind, EndpointKind] = FREE, width: float = WIDTH
) -> Instance:
    length = float(arc_lengths(xy)[-1])
    points = resample(xy, max(int(length / 3), 2))
    places = [
        Endpoint((float(x), float(y)), kind)
        for (x, y), kind in zip(points[[0, -1]], ends, strict=True)
    ]
    return Instance(points, width, length, False, SPLINE, tuple(places), score=0.95)


def scene(*instances: Instance, crossings: Sequence[Crossing] = ()) -> Scene:
    return Scene(tuple(instances), tuple(crossings), np.zeros((400, 640), np.uint8))


def wave(y: float, t: float = 0.0, dx: float = 0.0) -> np.ndarray:
    """A long cable about row ``y``, bending with time."""
    x = np.linspace(60, 560, 200)
    return np.column_stack([x + dx, y + 25 * np.sin(x / 90 + t)])


def run(frames: Sequence[Scene], params: TrackParams | None = None) -> list[Track]:
    track, tracks = Track(), []
    for frame in frames:
        track = follow(track, frame, params=params)
        tracks.append(track)
    return tracks


def ids_by_number(track: Track) -> dict[int, int]:
    return {cable.number: cable.id for cable in track.cables if cable.number}


@pytest.mark.slow
def test_ids_stay_although_the_order_of_the_instances_changes() -> None:
    rng = np.random.default_rng(0)
    track = Track()
    names: list[int] = []
    for t in range(60):
        rows = [100 + 40 * k + 12 * np.sin(0.2 * t + k) for k in range(4)]
        order = rng.permutation(4)
        track = follow(
            track,
            scene(*(instance(wave(rows[k], 0.05 * t)[:: rng.choice([-1, 1])]) for k in order)),
        )
        ids = ids_by_number(track)
        now = [ids[int(np.flatnonzero(order == k)[0]) + 1] for k in range(4)]
        names = names or now
        assert now == names
    assert all(cable.state == "seen" and cable.certainty > 0.9 for cable in track.cables)


def test_a_node_stays_the_same_place_on_the_cable() -> None:
    """Whichever way round the instance is given, node k keeps its arc length from the same end."""
    frames = [scene(instance(wave(200, 0.04 * t, 2.0 * t)[:: (-1) ** t])) for t in range(40)]
    for t, track in enumerate(run(frames)):
        true = resample(wave(200, 0.04 * t, 2.0 * t), NODES)
        assert np.abs(track.cables[0].xy - true).max() < WIDTH / 2


def test_a_covered_middle_leaves_one_cable_in_two_pieces() -> None:
    (whole,) = (wave(200),)
    pieces = [instance(whole[:80], ("free", "hidden")), instance(whole[130:], ("hidden", "free"))]
    tracks = run([scene(instance(whole)), scene(*pieces), scene(*pieces), scene(instance(whole))])
    covered = tracks[2].cables
    assert [c.id for c in covered] == [1]
    assert covered[0].state == "partly_covered"
    ((first, last),) = covered[0].covered
    assert first == pytest.approx(0.42, abs=0.05)
    assert last == pytest.approx(0.63, abs=0.05)
    assert np.abs(covered[0].xy - resample(whole, NODES)).max() < WIDTH
    assert tracks[3].cables[0].state == "seen"
    assert len(tracks[3].cables) == 1


def test_a_covered_end_keeps_the_correspondence_of_the_rest() -> None:
    whole = wave(200)
    part = instance(whole[60:], ("hidden", "free"))
    track = run([scene(instance(whole)), scene(part)])[-1]
    assert track.cables[0].covered[0][0] == 0.0
    assert np.abs(track.cables[0].xy - resample(whole, NODES)).max() < WIDTH


def test_a_cable_that_was_away_gets_its_id_back() -> None:
    three = [instance(wave(y)) for y in (100, 200, 300)]
    hidden = [three[0], three[2]]
    tracks = run([scene(*three)] * 3 + [scene(*hidden)] * 30 + [scene(*three)] * 2)
    assert [c.state for c in tracks[20].cables] == ["seen", "lost", "seen"]
    assert [c.id for c in tracks[-1].cables] == [1, 2, 3]
    assert [c.state for c in tracks[-1].cables] == ["seen"] * 3
    assert tracks[-1].cables[1].certainty < tracks[-1].cables[0].certainty


def test_a_cable_away_for_too_long_is_forgotten() -> None:
    tracks = run([scene(instance(wave(100)))] + [scene()] * 6, TrackParams(keep_frames=5))
    assert len(tracks[5].cables) == 1
    assert len(tracks[6].cables) == 0


def test_a_new_cable_gets_an_id_that_nobody_had() -> None:
    tracks = run(
        [scene(instance(wave(100))), scene(), scene(instance(wave(100)), instance(wave(300)))]
    )
    assert [(c.id, c.state) for c in tracks[-1].cables] == [(1, "seen"), (2, "new")]
    assert run([scene(instance(wave(300), width=20.0))])[0].cables[0].id == 1


def test_two_cables_that_change_places_keep_their_ids() -> None:
    """They cross each other on the way: whole curves and velocities tell them apart."""
    tracks = run(
        [scene(instance(wave(150 + 3 * t)), instance(wave(250 - 3 * t, 1.0))) for t in range(34)]
    )
    last = {c.id: c.xy[:, 1].mean() for c in tracks[-1].cables}
    assert last[1] > last[2]
    assert len(tracks[-1].cables) == 2


def test_what_could_be_either_of_two_is_not_certain() -> None:
    """One of two equal cables is gone and the other is right between their places."""
    near = [instance(wave(190)), instance(wave(210))]
    track = run([scene(*near), scene(instance(wave(200)))])[-1]
    assert min(c.certainty for c in track.cables if c.state != "lost") < 0.7


def test_a_cable_that_comes_in_over_the_border_grows() -> None:
    whole = wave(200)
    frames = [
        scene(instance(whole[200 - n :], ("border", "free")))
        for n in (100, 120, 140, 160, 180, 200)
    ]
    track = run(frames)[-1]
    assert [c.id for c in track.cables] == [1]
    assert track.cables[0].length_px == pytest.approx(float(arc_lengths(whole)[-1]), rel=0.05)
    assert np.abs(track.cables[0].xy - resample(whole, NODES)).max() < WIDTH


def crossed(over: int, score: float) -> Scene:
    cables = (
        instance(wave(200)),
        instance(np.column_stack([np.full(150, 300.0), np.linspace(80, 330, 150)])),
    )
    u = 0.49, 0.48
    ids = (1, 2) if over == 1 else (2, 1)
    places = [StrandPosition(k, u[k - 1]) for k in ids]
    return scene(*cables, crossings=[Crossing((300.0, 200.0), places[0], places[1], score)])


def test_one_doubtful_frame_does_not_turn_a_crossing_over() -> None:
    tracks = run([crossed(1, 0.97)] * 3 + [crossed(2, 0.7)] + [crossed(1, 0.97)])
    assert [(t.crossings[0].over, t.crossings[0].under) for t in tracks] == [(1, 2)] * 5
    assert tracks[3].crossings[0].score < tracks[2].crossings[0].score


def test_clear_frames_turn_a_crossing_over_at_last() -> None:
    tracks = run([crossed(1, 0.9)] * 2 + [crossed(2, 0.97)] * 8)
    assert tracks[-1].crossings[0].over == 2


def test_a_crossing_under_an_arm_is_remembered() -> None:
    full = crossed(1, 0.97)
    upper, lower = full.instances
    pieces = [
        instance(lower.centerline_xy[:30], ("free", "hidden")),
        instance(lower.centerline_xy[50:], ("hidden", "free")),
    ]
    track = run([full] * 3 + [scene(upper, *pieces)] * 5)[-1]
    assert [(c.over, c.under) for c in track.crossings] == [(1, 2)]
    assert 0.5 < track.crossings[0].score < 0.999


def test_an_empty_frame_and_an_empty_track_are_fine() -> None:
    assert follow(Track(), scene()).cables == ()
    assert follow(Track(), scene()).frame == 1


def test_colors_tell_equal_cables_apart() -> None:
    """Both jump to each other's place; only their colors say so."""
    image = np.zeros((400, 640, 3), np.uint8)
    image[:200], image[200:] = (200, 30, 30), (30, 30, 200)
    both = scene(instance(wave(172)), instance(wave(228)))
    swapped = follow(follow(Track(), both, image), both, np.ascontiguousarray(image[::-1]))
    assert ids_by_number(swapped) == {1: 2, 2: 1}


def lifted(y: float, apart: float) -> np.ndarray:
    """A level cable whose middle is ``apart`` px off row ``y``."""
    x = np.linspace(60, 560, 200)
    return np.column_stack([x, y + apart * np.sin(np.pi * (x - 60) / 500)])


def halves_changed(a: np.ndarray, b: np.ndarray) -> tuple[Instance, Instance]:
    """What a picture shows that goes on with the wrong strand in the middle."""
    return instance(np.concatenate([a[:100], b[100:]])), instance(
        np.concatenate([b[:100], a[100:]])
    )


def owners_of_ends(track: Track, a: np.ndarray, b: np.ndarray) -> list[int]:
    """Ids of the cables that are nearest to the quarter and the third quarter of both."""
    points = [a[50], a[150], b[50], b[150]]
    away = [[np.linalg.norm(c.xy - point, axis=1).min() for c in track.cables] for point in points]
    return [track.cables[int(np.argmin(row))].id for row in away]


def test_strands_met_tangled_are_told_apart_once_they_separate() -> None:
    """The first pictures joined the wrong halves, and the ids stayed with them for ever."""
    track = Track()
    for t in range(30):
        gap = 10.0 + 4 * max(t - 4, 0)
        a, b = lifted(200, -gap / 2), lifted(200, gap / 2)
        a[:, 1] -= 5
        b[:, 1] += 5
        shown = halves_changed(a, b) if gap < 20 else (instance(a), instance(b))
        track = follow(track, scene(*shown))
    left, right, other_left, other_right = owners_of_ends(track, a, b)
    assert left == right != other_left == other_right
    assert {c.state for c in track.cables if c.id in (left, other_left)} == {"seen"}


def test_what_was_seen_alone_outweighs_a_picture_that_joins_it_wrongly() -> None:
    """Two cables come to cross each other; then the pictures go on with the wrong strand at the
    crossing."""
    x, track = np.linspace(60, 560, 200), Track()
    for t in range(14):
        apart = 110.0 - 11 * min(t, 10)
        a = np.column_stack([x, np.linspace(150, 250, 200) - apart])
        b = np.column_stack([x, np.linspace(250, 150, 200) + apart])
        shown = [instance(a), instance(b)]
        crossings = []
        if apart < 50:
            u = 0.5 + apart / 100
            crossings = [
                Crossing((60 + 500 * u, 200.0), StrandPosition(1, u), StrandPosition(2, u), 0.6)
            ]
        if t > 10:
            shown = list(halves_changed(a, b))
        track = follow(track, scene(*shown, crossings=crossings))
    assert owners_of_ends(track, a, b) == [1, 1, 2, 2]
    assert len(track.cables) == 2


def test_a_doubt_that_goes_on_counts_once() -> None:
    """Thirty frames beside another cable made a certainty of nothing."""
    tracks = run(
        [scene(instance(wave(190)), instance(wave(210)))] + [scene(instance(wave(200)))] * 30
    )
    assert min(c.certainty for c in tracks[-1].cables) > 0.2


def test_a_place_keeps_its_arc_length_when_the_cable_grows_at_its_beginning() -> None:
    whole = wave(200)
    frames = [
        scene(instance(whole[200 - n :], ("border", "free")))
        for n in (100, 120, 140, 160, 180, 200)
    ]
    first, last = (tracks.cables[0] for tracks in (run(frames)[0], run(frames)[-1]))
    assert first.start_px == 0.0
    assert last.start_px == pytest.approx(first.length_px - last.length_px, abs=WIDTH)


def test_a_cable_that_was_met_too_short_gets_the_end_that_pictures_go_on_to_show() -> None:
    """What one picture gave as its free end was believed for ever: the rest of the cable belonged
    to nobody."""
    line = wave(200)
    short = instance(line[:140])
    track = run([scene(short), *([scene(instance(line))] * 10)])[-1]
    (cable,) = track.cables
    assert (cable.id, cable.state) == (1, "seen")
    assert cable.length_px == pytest.approx(float(arc_lengths(line)[-1]), rel=0.03)


def test_a_cable_that_was_met_too_long_gets_the_end_that_pictures_go_on_to_show() -> None:
    """A tail that was never there stayed out of view for ever, and took the pieces of other
    cables."""
    line = wave(200)
    tracks = run([scene(instance(line)), *([scene(instance(line[60:]))] * 10)])
    assert tracks[3].cables[0].covered
    (cable,) = tracks[-1].cables
    assert (cable.covered, cable.state) == ([], "seen")
    assert cable.start_px == pytest.approx(float(arc_lengths(line)[60]), abs=WIDTH)
    assert np.abs(cable.xy[0] - line[60]).max() < WIDTH


def test_an_end_that_was_covered_comes_back_with_its_arc_length() -> None:
    line = wave(200)
    under_arm = scene(instance(line[60:]))
    track = run(
        [*([scene(instance(line))] * 5), *([under_arm] * 30), *([scene(instance(line))] * 40)]
    )[-1]
    (cable,) = track.cables
    assert (cable.id, cable.state) == (1, "seen")
    assert cable.start_px == pytest.approx(0.0, abs=WIDTH)


@pytest.mark.slow
def test_the_course_tells_how_far_a_piece_without_ends_has_slid() -> None:
    """Only motion across a curve shows: errors along it added up while a cable was pulled to and
    fro."""
    x = np.linspace(-400, 1040, 1200)
    bent = np.column_stack([x, 200 + 60 * np.sin(x / 60) * np.exp(-(((x - 320) / 150) ** 2))])
    track, place = Track(), 600
    for t in range(100):
        now = bent + np.array([80 * np.sin(t / 20), 0.0])
        inside = np.flatnonzero((now[:, 0] >= 0) & (now[:, 0] < 640))
        track = follow(track, scene(instance(now[inside], ("border", "border"))))
        if t == 0:
            arc_length = float(arc_lengths(now[inside])[place - inside[0]])
    (cable,) = track.cables
    at = cable.start_px + cable.length_px * np.linspace(0, 1, NODES)
    found = np.array([np.interp(arc_length, at, axis) for axis in cable.xy.T])
    assert np.hypot(*(found - now[place])) < WIDTH


def test_a_gap_that_was_bridged_to_another_cable_is_not_part_of_either() -> None:
    """Under an arm a picture joined the wrong halves: the bridge counted as length, and the other
    half was lost."""
    a, b = wave(150), wave(250)
    left, right = a[:, 0] < 240, a[:, 0] > 400
    mask = np.zeros((400, 640), np.uint8)
    for line in (a[left], a[right], b[left], b[right]):
        cv2.polylines(mask, [np.rint(line).astype(np.int32)], False, 1, round(WIDTH))
    joined = [instance(np.concatenate([p[left], q[right]])) for p, q in ((a, b), (b, a))]
    track = run([scene(instance(a), instance(b))] * 5)[-1]
    for _ in range(12):
        track = follow(track, scene(*joined), mask=mask > 0)
    assert [cable.id for cable in track.cables] == [1, 2]
    for cable, line in zip(track.cables, (a, b), strict=True):
        assert np.abs(cable.xy[cable.seen] - resample(line, NODES)[cable.seen]).max() < WIDTH
        ((first, last),) = cable.covered
        assert 0.3 < first < last < 0.75
