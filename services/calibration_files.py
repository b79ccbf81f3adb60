"""Calibration files to intrinsics: ROS's ``camera_info`` YAML, OpenCV's FileStorage, Kalibr's
camchain.

Raises ValueError naming what is missing. Files are read without objects, anchors or aliases: none
of the three formats has them.
"""

from __future__ import annotations

import re
from typing import Any

import yaml
from dlo_client.contracts.cameras import AnyIntrinsics, CameraInfo, PinholeIntrinsics
from pydantic import ValidationError

LARGEST_BYTES = 64 * 1024
_OPENCV_MATRIX = "tag:yaml.org,2002:opencv-matrix"
_KALIBR_LENSES = {"radtan": "plumb_bob", "equidistant": "equidistant", "none": "plumb_bob"}
_OPENCV_SIZES = (
    ("image_width", "image_height"),
    ("width", "height"),
    ("imageWidth", "imageHeight"),
)
_OPENCV_MATRICES = ("camera_matrix", "cameraMatrix", "K", "M1")
_OPENCV_LENSES = ("distortion_coefficients", "distCoeffs", "D", "D1")


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # the package has no types
    """Plain values only."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases are not read")
        return super().compose_node(parent, index)


_Loader.add_constructor(
    _OPENCV_MATRIX, lambda loader, node: loader.construct_mapping(node, deep=True)
)


def intrinsics_of(text: str, camera: str = "cam0") -> AnyIntrinsics:
    """The intrinsics of a file; ``camera`` names one of a Kalibr camchain."""
    try:
        plain = re.sub(r"\A%YAML:[\d.]+\s*(---)?", "", text)
        found = yaml.load(plain, Loader=_Loader)  # nosec B506: a safe loader, without aliases
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"is no YAML: {' '.join(str(error).split())[:200]}") from None
    if not isinstance(found, dict):
        raise ValueError("is no calibration file: a mapping of names is expected")
    try:
        if "image_width" in found and isinstance(found.get("distortion_model"), str):
            return _ros(found)
        if any(isinstance(value, dict) and "intrinsics" in value for value in found.values()):
            return _kalibr(found, camera)
        return _opencv(found)
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None


def _ros(found: dict[str, Any]) -> CameraInfo:
    """Of camera_calibration and camera_info_manager."""
    return CameraInfo.model_validate(
        {
            "width": found["image_width"],
            "height": found.get("image_height"),
            "K": _data(found, ("camera_matrix",)),
            "D": _data(found, ("distortion_coefficients",)),
            "distortion_model": found["distortion_model"],
        }
    )


def _opencv(found: dict[str, Any]) -> PinholeIntrinsics:
    """Of OpenCV's calibration samples: names of fields differ from tool to tool."""
    size = next((pair for pair in _OPENCV_SIZES if pair[0] in found and pair[1] in found), None)
    if size is None:
        raise ValueError("has no image_width and image_height")
    matrix = _data(found, _OPENCV_MATRICES)
    if len(matrix) != 9:
        raise ValueError("its camera matrix is not 3 × 3")
    lens = _data(found, _OPENCV_LENSES)
    fisheye = str(found.get("fisheye_model", "0")) in ("1", "True", "true")
    return _pinhole(
        (found[size[0]], found[size[1]]),
        (matrix[0], matrix[4], matrix[2], matrix[5]),
        lens,
        "equidistant" if fisheye else None,
    )


def _kalibr(found: dict[str, Any], camera: str) -> PinholeIntrinsics:
    """One camera of a camchain: pinhole-radtan or pinhole-equi."""
    if camera not in found:
        raise ValueError(f"has no camera {camera!r}; there are {', '.join(map(str, found))}")
    one = found[camera]
    if one.get("camera_model", "pinhole") != "pinhole":
        raise ValueError(f"camera_model {one['camera_model']!r} is not read: calibrate as pinhole")
    lens = one.get("distortion_model", "none")
    if lens not in _KALIBR_LENSES:
        raise ValueError(f"distortion_model {lens!r} is not read; {', '.join(_KALIBR_LENSES)} are")
    if len(one["intrinsics"]) != 4 or len(one.get("resolution", ())) != 2:
        raise ValueError("intrinsics are fu fv pu pv, resolution is width and height")
    return _pinhole(
        tuple(one["resolution"]),
        tuple(one["intrinsics"]),
        one.get("distortion_coeffs", []),
        _KALIBR_LENSES[lens],
    )


def _pinhole(
    size: tuple[Any, ...], focal_and_center: tuple[Any, ...], lens: list[Any], model: str | None
) -> PinholeIntrinsics:
    fx, fy, cx, cy = focal_and_center
    fields = {
        "width": size[0],
        "height": size[1],
        "fx": fx,
        "fy": fy,
        "cx": cx,
        "cy": cy,
        "distortion": lens,
    }
    return PinholeIntrinsics.model_validate(fields | ({"distortion_model": model} if model else {}))


def _data(found: dict[str, Any], names: tuple[str, ...]) -> list[Any]:
    """The numbers of a matrix under one of these names; none if it is a lens that is left out."""
    name = next((name for name in names if name in found), None)
    if name is None:
        if names == _OPENCV_LENSES or names == ("distortion_coefficients",):
            return []
        raise ValueError(f"has no {names[0]}")
    value = found[name]
    numbers = value.get("data") if isinstance(value, dict) else value
    if not isinstance(numbers, list):
        raise ValueError(f"{name} has no data")
    return [item for row in numbers for item in (row if isinstance(row, list) else [row])]
