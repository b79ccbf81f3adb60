"""Calibration files as their tools write them."""

from __future__ import annotations

import pytest

from services.calibration_files import intrinsics_of

ROS = """
image_width: 640
image_height: 480
camera_name: narrow
camera_matrix:
  rows: 3
  cols: 3
  data: [511.2, 0, 318.5, 0, 510.9, 242.1, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.2, 0.05, 0.001, 0, 0]
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
"""
OPENCV = """%YAML:1.0
---
calibration_time: "Sat 28 Nov 2026"
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 511.2, 0., 318.5, 0., 510.9, 242.1, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -0.2, 0.05, 0.001, 0., 0. ]
"""
KALIBR = """
cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.2, 0.05, 0.001, 0.0]
  distortion_model: radtan
  intrinsics: [511.2, 510.9, 318.5, 242.1]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  camera_model: pinhole
  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]
  distortion_model: equidistant
  intrinsics: [400, 400, 320, 240]
  resolution: [640, 480]
"""


@pytest.mark.parametrize("text", [ROS, OPENCV, KALIBR], ids=["ros", "opencv", "kalibr"])
def test_the_same_camera_of_three_tools(text):
    found = intrinsics_of(text)
    taken = found.as_taken() if hasattr(found, "as_taken") else found
    assert (taken.width, taken.height) == (640, 480)
    assert (taken.fx, taken.fy, taken.cx, taken.cy) == pytest.approx((511.2, 510.9, 318.5, 242.1))
    assert taken.distortion[:3] == [-0.2, 0.05, 0.001]
    assert taken.lens == "plumb_bob"


def test_another_camera_of_a_camchain_is_a_fisheye():
    assert intrinsics_of(KALIBR, "cam1").lens == "equidistant"


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "mapping"),
        ("[1", "YAML"),
        ("a: 1", "image_width"),
        (ROS.replace("511.2", "-1"), "K"),
        (OPENCV.replace("camera_matrix", "other"), "camera_matrix"),
        (OPENCV.replace("318.5, 0., 510.9", "510.9"), "3 × 3"),
        (KALIBR.replace("pinhole", "omni"), "omni"),
        (KALIBR.replace("cam0", "left"), "cam0"),
        (KALIBR.replace("resolution: [640, 480]", "resolution: []"), "resolution"),
        ("a: &a [1]\nb: *a", "aliases"),
        ("!!python/object/apply:os.system ['true']", "YAML"),
        ("image_width: 1\nimage_height: 1\ncamera_matrix: 5", "data"),
    ],
)
def test_what_is_none_is_refused_in_words(text, word):
    with pytest.raises(ValueError, match=word):
        intrinsics_of(text)
