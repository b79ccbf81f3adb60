"""Places of results in the frames, units and conventions of robots, on scenes whose answer is
known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from dlo_client.contracts import InstancesResult, PlanShapeResult, SceneStatus
from dlo_client.contracts.frames import Output, Plane
from dlo_client.contracts.shape_plans import GripPose, PlannedAction, UsedParameters
from pydantic import ValidationError

from tests.clients import curve_samples, samples
from workers.robot_poses import robot_poses

DOWN = [[1, 0, 0, 0.1], [0, -1, 0, 0.2], [0, 0, -1, 0.5], [0, 0, 0, 1]]
"""Half a meter above (0.1, 0.2), looking down; the picture's x is the world's."""
CAMERA = {
    "intrinsics": {"width": 101, "height": 101, "fx": 100, "fy": 100, "cx": 50, "cy": 50},
    "T_world_camera": DOWN,
}


def seen(xy) -> InstancesResult:
    one = samples.two_cables().instances[0].model_copy(update={"centerline_xy": xy})
    status = SceneStatus(code="ok", limit=0.8, reasons=[])
    return samples.two_cables().model_copy(
        update={"instances": [one], "crossings": [], "status": status}
    )


ALONG_X = seen([(30.0, 50.0), (50.0, 50.0), (70.0, 50.0)])


def test_pixels_are_carried_to_the_plane():
    found = robot_poses(
        Output(camera=CAMERA, plane=Plane(offset_m=0.1), unit="mm", rotation="kuka_abc"), ALONG_X
    )
    assert [pose.role for pose in found.poses] == ["first", "middle", "last"]
    first, middle, last = (pose.position for pose in found.poses)
    assert middle == pytest.approx((100, 200, 100))
    assert first == pytest.approx((100 - 80, 200, 100))  # 20 px at 0.4 m and 100 px a meter
    assert last == pytest.approx((180, 200, 100))
    assert found.poses[1].rotation == pytest.approx([0, 0, 180]), (
        "x along the cable, z down: turned about x"
    )
    assert found.warnings == []


def test_in_the_camera_and_in_a_frame_of_your_own():
    camera = robot_poses(Output(camera=CAMERA, frame="camera"), ALONG_X).poses[1]
    assert camera.position == pytest.approx((0, 0, 0.5))
    assert camera.rotation == pytest.approx([0, 0, 0, 1]), (
        "z of a camera that looks down goes down as well"
    )
    fixture = [[0, -1, 0, 0.1], [1, 0, 0, 0.2], [0, 0, 1, 0], [0, 0, 0, 1]]
    own = robot_poses(Output(camera=CAMERA, frame="fixture-3", T_world_frame=fixture), ALONG_X)
    assert own.poses[2].position == pytest.approx((0, -0.1, 0)), "the world's x is the fixture's -y"
    assert own.frame == "fixture-3"


def test_with_a_tool_the_poses_are_the_flange_s():
    tool = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.15], [0, 0, 0, 1]]
    found = robot_poses(Output(camera=CAMERA, T_flange_tool=tool), ALONG_X)
    assert found.of == "flange"
    assert found.poses[1].position == pytest.approx((0.1, 0.2, 0.15)), (
        "the tool points down and is 0.15 m long"
    )


def test_a_lens_is_taken_into_account():
    bent = CAMERA | {"intrinsics": CAMERA["intrinsics"] | {"distortion": [-0.2, 0.0, 0.0, 0.0]}}
    straight, real = (
        robot_poses(Output(camera=c), ALONG_X).poses[0].position[0] for c in (CAMERA, bent)
    )
    assert real < straight - 1e-4


def test_a_dlo_beyond_the_horizon_is_left_out_with_a_warning():
    level = [[1, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0.5], [0, 0, 0, 1]]
    found = robot_poses(Output(camera=CAMERA | {"T_world_camera": level}), ALONG_X)
    assert found.poses == []
    assert "plane" in found.warnings[0]


def test_an_action_on_the_table():
    pick, place = (
        GripPose(xy_m=(0.1, 0.0), angle_rad=np.pi / 2),
        GripPose(xy_m=(0.2, 0.1), angle_rad=0.0),
    )
    action = PlannedAction(
        edge=4,
        dx_m=0.1,
        dy_m=0.1,
        dtheta_rad=-np.pi / 2,
        pick=pick,
        place=place,
        error_after_m=0,
        error_at_end_m=0,
        converged=True,
        checks=[],
    )
    result = PlanShapeResult.model_construct(
        action=action, parameters=UsedParameters.model_construct()
    )
    found = robot_poses(Output(plane=Plane(offset_m=0.02), rotation="kuka_abc"), result)
    assert [(pose.role, pose.id) for pose in found.poses] == [("pick", 4), ("place", 4)]
    assert found.poses[0].position == (0.1, 0.0, 0.02)
    assert found.poses[0].rotation == pytest.approx([90, 0, 180])


def test_curves_of_space_need_no_camera():
    result = curve_samples.result()
    found = robot_poses(Output(frame="camera"), result)
    assert len(found.poses) == 3 * (1 + len(result.others))
    inverse = np.linalg.inv(np.array(result.views[0].T_world_camera))
    expected = (inverse @ [*result.curve.points_m[0], 1])[:3]
    assert found.poses[0].position == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("output", "kind", "word"),
    [
        ({}, "segment", "output"),
        ({}, "instances", "camera"),
        ({"frame": "camera"}, "plan_shape", "camera"),
    ],
)
def test_what_cannot_be_placed_is_refused(output, kind, word):
    with pytest.raises(ValueError, match=word):
        Output(**output).check_fits(kind)


@pytest.mark.parametrize(
    "output",
    [
        {"frame": "fixture"},
        {"T_world_frame": DOWN},
        {"plane": {"normal": [0, 0, 0]}},
        {"unit": "inch"},
    ],
)
def test_outputs_that_mean_nothing_are_refused(output):
    with pytest.raises(ValidationError):
        Output.model_validate(output)


@pytest.mark.parametrize(
    ("in_camera", "expected"), [(False, (0.0, 0.1, 0.3)), (True, (0.1, 0.1, 0.2))]
)
def test_curves_of_depth_are_taken_as_they_are(in_camera, expected):
    """In the world, or in the camera's frame where the request does not place the camera."""
    curve = [(0.0, 0.1, 0.3), (0.1, 0.1, 0.3), (0.2, 0.1, 0.3)]
    one = ALONG_X.instances[0]
    deep = SimpleNamespace(
        id=one.id, score=one.score, centerline_xy=one.centerline_xy, curve_m=curve
    )
    found = robot_poses(
        Output(camera=CAMERA), ALONG_X.model_copy(update={"instances": [deep]}), in_camera=in_camera
    )
    assert found.poses[0].position == pytest.approx(expected)
    bare = robot_poses(Output(), ALONG_X)
    assert bare.poses == []
    assert "names no camera" in bare.warnings[0]
