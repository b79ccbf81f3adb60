"""``label_tracked`` on rendered pictures and the shipped corrector, and what it refuses."""

from __future__ import annotations

import io

import numpy as np
import pytest
from dlo_client.contracts import (
    CameraView,
    ImageRef,
    LabelTrackedRequest,
    PinholeIntrinsics,
    Stroke,
)
from PIL import Image
from pydantic import ValidationError

from models.geometry.rle import decode
from tests.benchmarks.tracked_scenes import TrackedScene, tracked_scene
from workers import stages
from workers.stages.outcome import InvalidInput, Outcome, Tools

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def scene() -> TrackedScene:
    return tracked_scene(1, views=4)


def request(scene: TrackedScene, tools: Tools, **more: object) -> LabelTrackedRequest:
    views = [
        view(image, camera, tools)
        for image, camera in zip(scene.images, scene.cameras, strict=True)
    ]
    strokes = [
        Stroke(points_m=points.tolist(), thickness_m=thick, name=f"cable {k}")
        for k, (points, thick) in enumerate(zip(scene.strokes_m, scene.thickness_m, strict=True))
    ]
    return LabelTrackedRequest(**({"views": views, "strokes": strokes} | more))


def view(image: np.ndarray, camera, tools: Tools) -> CameraView:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "PNG")
    i = camera.intrinsics
    intrinsics = PinholeIntrinsics(
        width=i.width, height=i.height, fx=i.fx, fy=i.fy, cx=i.cx, cy=i.cy
    )
    ref = ImageRef(id=tools.blobs.put(buffer.getvalue()))
    return CameraView(
        image=ref, intrinsics=intrinsics, T_world_camera=camera.T_world_camera.tolist()
    )


@pytest.fixture(scope="module")
def outcome(scene, tools) -> Outcome:
    """Of the request with nothing but views and strokes."""
    return stages.run(request(scene, tools), tools)


def test_strokes_become_labels_of_every_view(scene, outcome):
    assert set(outcome.files) == {
        f"{name}_{k}.png" for name in ("labels", "overlay") for k in range(4)
    }
    overlaps = []
    for labels, true in zip(outcome.result.views, scene.ids, strict=True):
        assert [i.id for i in labels.instances] == [1, 2]
        for item in labels.instances:
            mask = decode(item.mask_rle.counts, item.mask_rle.size)
            overlaps.append((mask & (true == item.id)).sum() / (mask | (true == item.id)).sum())
            assert len(item.centerline_xy) == len(item.offset_px) == len(item.trust)
        assert labels.moved_px > 0.5
        assert {(c.over.instance, c.under.instance) for c in labels.crossings} <= {(1, 2), (2, 1)}
    assert np.mean(overlaps) > 0.75
    assert outcome.result.models[0].name == "labelling_corrector"
    assert outcome.result.views[0].instances[0].name == "cable 0"


def test_without_correction_the_strokes_stay_as_drawn(scene, tools):
    result = stages.run(request(scene, tools, correct=False, files=[]), tools).result
    assert result.views[0].moved_px == 0
    assert result.models == []


def test_ends_are_found_unless_that_is_off(scene, tools, outcome):
    off = stages.run(request(scene, tools, files=[], find_ends=False), tools)
    found, marked = (o.result.views[0].instances[0].centerline_xy for o in (outcome, off))
    assert np.hypot(*np.subtract(found[0], marked[0])) > 0.5
    assert found[len(found) // 2] == marked[len(marked) // 2]


def test_the_same_request_gives_the_same_answer(scene, tools, outcome):
    assert stages.run(request(scene, tools, files=[]), tools).result == outcome.result


def test_a_tracker_frame_is_taken_into_the_world(scene, tools):
    turn = np.array([[0, -1, 0, 0.3], [1, 0, 0, -0.2], [0, 0, 1, 0.1], [0, 0, 0, 1]], float)
    back = np.linalg.inv(turn)
    strokes = [
        Stroke(points_m=(p @ back[:3, :3].T + back[:3, 3]).tolist(), thickness_m=t)
        for p, t in zip(scene.strokes_m, scene.thickness_m, strict=True)
    ]
    direct = stages.run(request(scene, tools, correct=False, files=[]), tools).result
    turned = request(
        scene, tools, correct=False, files=[], strokes=strokes, T_world_tracker=turn.tolist()
    )
    found = stages.run(turned, tools).result
    for a, b in zip(found.views, direct.views, strict=True):
        for got, want in zip(a.instances, b.instances, strict=True):
            np.testing.assert_allclose(got.centerline_xy, want.centerline_xy, atol=0.05)


def test_strokes_outside_every_picture_are_refused(scene, tools):
    away = [Stroke(points_m=[(5, 5, 0), (6, 5, 0)], thickness_m=0.01)]
    with pytest.raises(InvalidInput, match="T_world_tracker") as caught:
        stages.run(request(scene, tools, strokes=away), tools)
    assert caught.value.field == "strokes.0.points_m"


def test_intrinsics_of_another_size_are_refused(scene, tools):
    views = request(scene, tools).views
    small = PinholeIntrinsics(width=320, height=240, fx=300, fy=300, cx=160, cy=120)
    wrong = [views[0], views[1].model_copy(update={"intrinsics": small})]
    with pytest.raises(InvalidInput, match="320 × 240") as caught:
        stages.run(request(scene, tools, views=wrong), tools)
    assert caught.value.field == "views.1.intrinsics"


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"strokes": []}, "strokes"),
        ({"views": []}, "views"),
        ({"strokes": [{"points_m": [[0, 0, 0]], "thickness_m": 0.01}]}, "points_m"),
        ({"strokes": [{"points_m": [[0, 0, 0], [0, 0, 0]], "thickness_m": 0.01}]}, "one place"),
        ({"strokes": [{"points_m": [[0, 0, 0], [1, 0, 0]], "thickness_m": 0}]}, "thickness_m"),
        (
            {"strokes": [{"points_m": [[0, 0, 0], [float("nan"), 0, 0]], "thickness_m": 0.1}]},
            "points_m",
        ),
        ({"spacing_px": 0.1}, "spacing_px"),
    ],
)
def test_bad_requests_name_their_field(change, named):
    pose = np.eye(4).tolist()
    intrinsics = {"width": 64, "height": 48, "fx": 50, "fy": 50, "cx": 32, "cy": 24}
    good = {
        "views": [{"intrinsics": intrinsics, "T_world_camera": pose}],
        "strokes": [{"points_m": [[0, 0, 1], [0.1, 0, 1]], "thickness_m": 0.01}],
    }
    LabelTrackedRequest.model_validate(good)
    with pytest.raises(ValidationError, match=named):
        LabelTrackedRequest.model_validate(good | change)
