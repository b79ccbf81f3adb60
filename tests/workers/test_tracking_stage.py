"""``instances`` with ``previous``: cables keep their ids through answers that travel as JSON."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from dlo_client.contracts import ImageRef, InstancesRequest, InstancesResult, TrackState
from dlo_client.contracts.tracking import NODES
from PIL import Image
from pydantic import ValidationError

from models.weights.inference import Runtime
from workers.blobs import FolderBlobs
from workers.stages import instances, tracking
from workers.stages.outcome import InvalidInput, Tools


@pytest.fixture(scope="module")
def tools(tmp_path_factory) -> Tools:
    blobs = FolderBlobs(tmp_path_factory.mktemp("blobs"), 3600.0)
    return Tools(blobs, 1_000_000, Runtime(["CPUExecutionProvider"], 1, spinning=False))


def mask(tools: Tools, *rows: float) -> ImageRef:
    """Level cables of 7 px in a picture of 200 × 120, from x = 20 to 180."""
    drawn = np.zeros((120, 200), np.uint8)
    for y in rows:
        cv2.line(drawn, (20, round(y)), (180, round(y)), 255, 7)
    buffer = io.BytesIO()
    Image.fromarray(drawn).save(buffer, "PNG")
    return ImageRef(id=tools.blobs.put(buffer.getvalue()))


def look(tools: Tools, previous: TrackState, *rows: float, **more: object) -> InstancesResult:
    request = InstancesRequest(mask=mask(tools, *rows), previous=previous, files=[], **more)
    result = instances.run(
        InstancesRequest.model_validate_json(request.model_dump_json()), tools
    ).result
    return InstancesResult.model_validate_json(result.model_dump_json())


def test_ids_stay_through_stateless_requests(tools):
    track = TrackState()
    for t in range(6):
        result = look(tools, track, 30 + 2 * t, 90 - t)
        track = result.track
        by_id = {cable.id: cable.centerline_xy[NODES // 2][1] for cable in result.cables}
        assert by_id == {1: pytest.approx(30 + 2 * t, abs=1.5), 2: pytest.approx(90 - t, abs=1.5)}
    assert track.frame == 6
    assert {cable.state for cable in result.cables} == {"seen"}
    assert all(cable.covered == [] and cable.certainty > 0.9 for cable in result.cables)
    assert {result.instances[cable.instance - 1].length_px for cable in result.cables}


def test_the_state_of_a_track_travels_whole(tools):
    track = look(tools, look(tools, TrackState(), 30, 90).track, 31, 89).track
    assert tracking.encode(tracking.decode(track)) == track
    assert track.cables[0].course == pytest.approx([np.pi] * (NODES - 1), abs=0.05)


def test_a_state_of_an_earlier_version_has_no_course_yet(tools):
    track = look(tools, TrackState(), 30, 90).track
    older = track.model_dump(mode="json")
    for cable in older["cables"]:
        del cable["course"], cable["doubted"]
    after = look(tools, TrackState.model_validate(older), 31, 90)
    assert [cable.id for cable in after.cables] == [1, 2]
    (first, _), (other, _) = after.track.cables, look(tools, track, 31, 90).track.cables
    assert first.course == pytest.approx(other.course, abs=1e-3)


def test_a_cable_that_is_away_is_lost_and_comes_back(tools):
    track = look(tools, look(tools, TrackState(), 30, 90).track, 30, 90).track
    away = look(tools, track, 30)
    assert {cable.id: cable.state for cable in away.cables} == {1: "seen", 2: "lost"}
    assert away.cables[1].instance is None
    back = look(tools, away.track, 30, 92)
    assert {cable.id: cable.state for cable in back.cables} == {1: "seen", 2: "seen"}


def test_without_previous_nothing_is_tracked(tools):
    result = instances.run(InstancesRequest(mask=mask(tools, 30), files=[]), tools).result
    assert (result.cables, result.cable_crossings, result.track) == (None, None, None)


def test_pictures_far_apart_in_time_are_expected_further_on(tools):
    """A cable moves 4 px a frame; the frame after a pause of five is 20 px on, nearer to where the
    other one was."""
    track = TrackState()
    for t in range(8):
        track = look(tools, track, 20 + 4 * t, 100, time_s=0.1 * t).track
    after = look(tools, track, 20 + 4 * 12, 100, time_s=1.2)
    moved = {cable.id: cable.centerline_xy[NODES // 2][1] for cable in after.cables}
    assert moved[1] == pytest.approx(68, abs=1.5)
    assert after.track.step_s == pytest.approx(0.14, abs=0.01)


def test_time_that_runs_backwards_is_refused(tools):
    track = look(tools, TrackState(), 30, time_s=5.0).track
    with pytest.raises(InvalidInput) as refused:
        look(tools, track, 30, time_s=4.0)
    assert refused.value.field == "time_s"


@pytest.mark.parametrize("change", ["twice", "next_id"])
def test_ids_that_contradict_one_another_are_refused(tools, change):
    track = look(tools, TrackState(), 30).track
    bad = {"twice": {"cables": [*track.cables, *track.cables]}, "next_id": {"next_id": 1}}[change]
    with pytest.raises(InvalidInput) as refused:
        look(tools, track.model_copy(update=bad), 30)
    assert refused.value.field.startswith("previous.")


def test_a_time_without_a_track_and_nodes_that_are_missing_are_refused(tools):
    with pytest.raises(ValidationError, match="time_s"):
        InstancesRequest(time_s=1.0)
    cable = look(tools, TrackState(), 30).track.cables[0].model_dump()
    with pytest.raises(ValidationError):
        TrackState(cables=[cable | {"xy": cable["xy"][1:]}])


def test_a_track_of_another_picture_is_no_fault(tools):
    """Numbers at the limits of the contract lead to lost cables, not to an error of arithmetic."""
    track = look(tools, TrackState(), 30).track
    (cable,) = track.cables
    far = cable.model_copy(update={"xy": [(1e6, -1e6)] * NODES, "velocity": [(1e5, 1e5)] * NODES})
    result = look(tools, track.model_copy(update={"cables": [far]}), 30)
    assert result.cables[0].id == 1
    assert {cable.state for cable in result.cables} <= {"lost", "new", "seen", "partly_covered"}
