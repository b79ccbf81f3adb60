"""Poses from which a robot takes the pictures of a scene (thesis 2.5.1, eq. 2.3): ``python -m
models.tracked_labels``.

The camera moves over a part of an ellipsoid around the scene and always looks at its center. A line
a pose: x, y, z in millimeters and the rotation, as text for a robot, or the 4 × 4 matrices in
meters as one JSON list, which is how the views of ``label_tracked`` and ``reconstruct`` name them.
``--camera`` turns them into poses of the flange.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from models.geometry.arrays import FloatArray
from models.tracked_labels.trajectory import Ellipsoid, ellipsoid_poses

FORMS = ("json", "quaternion_xyzw", "rotation_vector", "euler_zyx_deg")


def line(pose: FloatArray, form: str) -> str:
    """x, y, z in mm and the rotation of a (4, 4) pose in meters."""
    turn = Rotation.from_matrix(pose[:3, :3])
    if form == "quaternion_xyzw":
        numbers = turn.as_quat(canonical=True)
    elif form == "rotation_vector":
        numbers = turn.as_rotvec()
    else:
        numbers = turn.as_euler("ZYX", degrees=True)
    return " ".join(f"{value:.6f}" for value in [*(1000 * pose[:3, 3]), *numbers])


def flange_from_camera(file: Path) -> FloatArray:
    """(4, 4) T_camera_flange of a JSON file as ``dlo calibrate`` prints it. Raises ValueError when
    it holds none."""
    read = json.loads(file.read_text())
    pose = np.asarray(read.get("T_flange_camera") if isinstance(read, dict) else read, np.float64)
    if pose.shape != (4, 4) or not np.allclose(pose[3], (0, 0, 0, 1)):
        raise ValueError(f"{file} holds no 4 × 4 matrix T_flange_camera")
    return np.asarray(np.linalg.inv(pose), np.float64)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m models.tracked_labels",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--center",
        type=float,
        nargs=3,
        required=True,
        metavar=("X", "Y", "Z"),
        help="what the camera looks at, meters in the robot's base frame",
    )
    parser.add_argument(
        "--axes",
        type=float,
        nargs=3,
        default=(0.35, 0.35, 0.35),
        metavar=("A", "B", "C"),
        help="semi-axes of the ellipsoid, meters",
    )
    parser.add_argument(
        "--zenith",
        type=float,
        nargs=2,
        default=(8.0, 40.0),
        metavar=("FROM", "TO"),
        help="degrees from the vertical, first and last ring",
    )
    parser.add_argument(
        "--azimuth",
        type=float,
        nargs=2,
        default=(-180.0, 180.0),
        metavar=("FROM", "TO"),
        help="degrees about the vertical",
    )
    parser.add_argument("--rings", type=int, default=3)
    parser.add_argument("--per-ring", type=int, default=12, help="pictures a ring")
    parser.add_argument(
        "--camera", type=Path, help="JSON with T_flange_camera, as `dlo calibrate` prints it"
    )
    parser.add_argument("--form", choices=FORMS, default="json")
    return parser


def main(arguments: list[str] | None = None) -> int:
    asked = _parser().parse_args(arguments)
    low, high = np.radians(asked.zenith)
    first, last = np.radians(asked.azimuth)
    a, b, c = asked.axes
    ellipsoid = Ellipsoid(
        a, b, c, tuple(asked.center), theta_rad=(low, high), phi_rad=(first, last)
    )
    try:
        poses = ellipsoid_poses(ellipsoid, asked.rings, asked.per_ring)
        if asked.camera is not None:
            poses = poses @ flange_from_camera(asked.camera)
    except (OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if asked.form == "json":
        print(json.dumps(np.round(poses, 9).tolist()))
    else:
        print("\n".join(line(pose, asked.form) for pose in poses))
    return 0


if __name__ == "__main__":
    sys.exit(main())
