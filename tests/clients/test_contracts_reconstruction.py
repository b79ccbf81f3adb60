"""Cameras and requests of the reconstruction: what ROS and OpenCV say is taken, what cannot be
right is refused."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from dlo_client.contracts import CameraInfo, PinholeIntrinsics, ReconstructRequest
from dlo_client.contracts.cameras import AnyIntrinsics
from pydantic import TypeAdapter, ValidationError

INTRINSICS: TypeAdapter[AnyIntrinsics] = TypeAdapter(AnyIntrinsics)

SHORTHAND: dict[str, Any] = {
    "width": 640,
    "height": 480,
    "fx": 601.5,
    "fy": 602.5,
    "cx": 318.0,
    "cy": 241.0,
}
ROS2: dict[str, Any] = {
    "header": {
        "stamp": {"sec": 1764032400, "nanosec": 20000000},
        "frame_id": "camera_color_optical_frame",
    },
    "height": 480,
    "width": 640,
    "distortion_model": "plumb_bob",
    "d": [-0.05, 0.06, 0.0003, -0.0002, 0.0],
    "k": [601.5, 0.0, 318.0, 0.0, 602.5, 241.0, 0.0, 0.0, 1.0],
    "r": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
    "p": [601.5, 0.0, 318.0, 0.0, 0.0, 602.5, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    "binning_x": 0,
    "binning_y": 0,
    "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
}
"""As ``ros2 topic echo`` prints a sensor_msgs/CameraInfo."""


def above(x: float, **changes: Any) -> dict[str, Any]:
    pose = [[1, 0, 0, x], [0, -1, 0, 0], [0, 0, -1, 0.3], [0, 0, 0, 1]]
    return {"intrinsics": SHORTHAND, "T_world_camera": pose} | changes


def pose(
    rotation: np.ndarray, last: tuple[float, ...] = (0, 0, 0, 1), x: float = 0.0
) -> list[list[float]]:
    return [[*map(float, row), t] for row, t in zip(rotation, (x, 0.0, 0.3), strict=True)] + [
        list(last)
    ]


def refusal(**fields: Any) -> str:
    with pytest.raises(ValidationError) as caught:
        ReconstructRequest.model_validate(fields)
    return "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in caught.value.errors())


def test_a_ros_message_is_taken_as_it_is():
    taken = INTRINSICS.validate_python(ROS2)
    assert isinstance(taken, CameraInfo)
    assert (taken.K[0], taken.K[4], taken.K[2], taken.K[5]) == (601.5, 602.5, 318.0, 241.0)
    assert ROS2["d"] == taken.D


def test_ros_1_writes_its_matrices_in_capitals():
    message = {k.upper() if len(k) == 1 else k: v for k, v in ROS2.items()}
    assert INTRINSICS.validate_python(message) == INTRINSICS.validate_python(ROS2)


def test_a_camera_info_comes_back_from_json():
    taken = INTRINSICS.validate_python(ROS2)
    assert INTRINSICS.validate_json(INTRINSICS.dump_json(taken)) == taken


@pytest.mark.parametrize("count", [0, 4, 5, 8, 12, 14])
def test_the_opencv_shorthand(count):
    taken = INTRINSICS.validate_python(SHORTHAND | {"distortion": [0.01] * count})
    assert isinstance(taken, PinholeIntrinsics)
    assert len(taken.distortion) == count


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"k": [0.0] * 9}, "calibrated"),
        ({"k": [600, 2.0, 320, 0, 600, 240, 0, 0, 1]}, "`K` is fx 0 cx"),
        ({"k": [600, 0, 320]}, "at least 9"),
        ({"d": [0.1] * 8}, "plumb_bob"),
        ({"distortion_model": "mystery"}, "plumb_bob"),
    ],
)
def test_a_message_that_describes_no_camera_is_refused(changes, said):
    assert said in refusal(views=[above(0.0, intrinsics=ROS2 | changes), above(0.05)])


@pytest.mark.parametrize(
    ("model", "count", "name"),
    [
        ("plumb_bob", 5, "plumb_bob"),
        ("rational_polynomial", 8, "rational_polynomial"),
        ("rational_polynomial", 14, "rational_polynomial"),
        ("equidistant", 4, "equidistant"),
        ("equidistant", 0, "equidistant"),
        ("fisheye", 4, "equidistant"),
        ("", 0, "plumb_bob"),
    ],
)
def test_the_lenses_that_drivers_publish(model, count, name):
    taken = INTRINSICS.validate_python(ROS2 | {"distortion_model": model, "d": [0.01] * count})
    assert isinstance(taken, CameraInfo)
    assert (taken.as_taken().lens, len(taken.as_taken().distortion)) == (name, count)


def test_opencvs_fisheye_has_a_name_of_its_own():
    """Four coefficients alone are those of the polynomial; they used to be the only reading."""
    fisheye = SHORTHAND | {"distortion": [0.01] * 4, "distortion_model": "equidistant"}
    assert INTRINSICS.validate_python(fisheye).lens == "equidistant"
    assert INTRINSICS.validate_python(SHORTHAND | {"distortion": [0.01] * 4}).lens == "plumb_bob"


def test_binning_and_the_region_of_interest_are_applied():
    """Both were passed over: curves 409 mm and 43 mm from where they are. REP 104: all else is of
    full resolution."""
    message = ROS2 | {
        "width": 1280,
        "height": 960,
        "k": [1200.0, 0, 639.5, 0, 1210.0, 479.5, 0, 0, 1],
    }
    binned = INTRINSICS.validate_python(message | {"binning_x": 2, "binning_y": 4})
    assert binned.picture_size == (640, 240)
    i = binned.as_taken()
    assert (i.fx, i.fy, i.cx, i.cy) == (600.0, 302.5, 319.5, 119.5)
    part = {"x_offset": 100, "y_offset": 50, "width": 640, "height": 480, "do_rectify": False}
    cut = INTRINSICS.validate_python(message | {"roi": part})
    assert cut.picture_size == (640, 480)
    assert (cut.as_taken().cx, cut.as_taken().cy, cut.as_taken().fx) == (539.5, 429.5, 1200.0)
    both = INTRINSICS.validate_python(message | {"roi": part, "binning_x": 2, "binning_y": 2})
    assert both.picture_size == (320, 240)
    assert (both.as_taken().cx, both.as_taken().fx) == (269.5, 600.0)
    assert INTRINSICS.validate_json(both.model_dump_json()) == both


def test_a_region_outside_of_the_full_resolution_is_refused():
    part = {"x_offset": 100, "y_offset": 50, "width": 640, "height": 480}
    message = refusal(views=[above(0.0, intrinsics=ROS2 | {"roi": part}), above(0.05)])
    assert "`roi` reaches beyond" in message
    assert "full resolution" in message


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"fx": 0.9375, "fy": 1.25, "cx": 0.5, "cy": 0.5}, "multiply fx and cx by the width"),
        ({"cx": 0.5, "cy": 0.5}, "multiply cx by the width"),
        ({"fx": 1e-300}, "too few pixels"),
        ({"fy": 3.0}, "too few pixels"),
        ({"fx": 90_000.0}, "times longer"),
        ({"cx": 100_000.0}, "beside the camera"),
    ],
)
def test_optics_that_no_camera_has_are_refused_with_the_likely_unit(changes, said):
    """Shares of the picture instead of pixels gave a curve 420 mm off without a word."""
    assert said in refusal(views=[above(0.0, intrinsics=SHORTHAND | changes), above(0.05)])


def test_one_view_is_not_enough():
    assert "views: List should have at least 2 items" in refusal(views=[above(0.0)])


def test_equal_poses_say_that_the_camera_has_to_move():
    assert "same place" in refusal(views=[above(0.02), above(0.02), above(0.02)])
    turned = above(0.02, T_world_camera=pose(np.diag([-1.0, 1.0, -1.0]), x=0.02))
    assert "same place" in refusal(views=[above(0.02), turned])
    assert ReconstructRequest.model_validate({"views": [above(0.02), above(0.02), above(0.03)]})


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        (pose(1.1 * np.eye(3)), "not orthonormal"),
        (pose(np.array([[1, 0.1, 0], [0, 1, 0], [0, 0, 1]])), "not orthonormal"),
        (pose(np.diag([1.0, 1.0, -1.0])), "mirrored"),
        (pose(np.zeros((3, 3))), "not orthonormal"),
        (pose(np.eye(3), last=(0, 0, 0.3, 1)), "0 0 0 1"),
        (pose(np.eye(3), x=float("nan")), "finite"),
        (pose(np.eye(3), x=25_000.0), "meters"),
        ([[1, 0, 0, 0]] * 3, "T_world_camera"),
    ],
)
def test_a_pose_that_is_no_rotation_is_named(bad, said):
    message = refusal(views=[above(0.0), above(0.05, T_world_camera=bad)])
    assert said in message
    assert "views.1.T_world_camera" in message


def test_a_target_in_a_view_that_is_not_there():
    assert "there are 2 views" in refusal(
        views=[above(0.0), above(0.05)], target={"view": 2, "xy": [10, 10]}
    )
    assert "xy or instance" in refusal(views=[above(0.0), above(0.05)], target={"view": 0})
