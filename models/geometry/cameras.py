"""Cameras: pinhole with lens distortion at a known pose.

Two kinds of pixels: those of the picture as it was taken, and *ideal* ones, where the same camera
without distortion would see the point. Geometry is done in ideal pixels; only drawing goes back to
the picture. World to camera: ``X_c = R^T (X_w - t)`` with ``T_world_camera = [R t; 0 1]``, z
forward, y down (OpenCV).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.geometry import lenses
from models.geometry.arrays import BoolArray, FloatArray
from models.geometry.lenses import DistortionModel

_ROTATION_TOLERANCE = 1e-3
_LEAST_FIELD = 0.5
"""Of the picture's half diagonal that a lens has to show without folding."""
NEAREST_M = 1e-6
"""A point is in front of a camera if its depth is greater."""


class CameraError(ValueError):
    """No camera can have these intrinsics or this pose."""


@dataclass(frozen=True)
class Intrinsics:
    """``fx, fy, cx, cy`` in pixels of a ``width`` × ``height`` picture; the first pixel's center is
    (0, 0).

    ``distortion``: coefficients in OpenCV's order (ROS's names of models): ``plumb_bob`` k1 k2 p1
    p2 [k3], ``rational_polynomial`` k1 k2 p1 p2 k3 k4 k5 k6 [s1 s2 s3 s4 [tx ty]]; none is a
    pinhole. ``equidistant`` (fisheye) k1 k2 k3 k4; none is all 0.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()
    model: DistortionModel = "plumb_bob"

    def __post_init__(self) -> None:
        if min(self.fx, self.fy) <= 0 or min(self.width, self.height) <= 0:
            raise CameraError("focal lengths and sizes are positive")
        counts = lenses.COUNTS[self.model]
        if len(self.distortion) not in counts:
            wanted = " or ".join(map(str, counts))
            raise CameraError(f"{self.model} has {wanted} coefficients, not {len(self.distortion)}")
        if self.distorted and self._folds_inside():
            raise CameraError(
                f"a {self.model} lens with these coefficients folds in the middle of the picture"
            )

    @property
    def matrix(self) -> FloatArray:
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def distorted(self) -> bool:
        return lenses.bends(self.model, self.distortion)

    def scaled(self, scale: float) -> Intrinsics:
        """Of the same camera with ``scale`` pixels for each; pixel centers at ``(k + 0.5) s -
        0.5``."""
        cx, cy = ((c + 0.5) * scale - 0.5 for c in (self.cx, self.cy))
        width, height = (max(round(side * scale), 1) for side in (self.width, self.height))
        return replace(
            self, width=width, height=height, fx=self.fx * scale, fy=self.fy * scale, cx=cx, cy=cy
        )

    def _folds_inside(self) -> bool:
        half = np.hypot(self.width / self.fx, self.height / self.fy) / 2
        return lenses.bent_field(self.model, self.distortion) < _LEAST_FIELD * half


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera at a pose; ``T_world_camera`` (4, 4). Raises CameraError for what is no rigid
    motion."""

    intrinsics: Intrinsics
    T_world_camera: FloatArray

    def __post_init__(self) -> None:
        check_pose(self.T_world_camera)

    @property
    def rotation(self) -> FloatArray:
        """(3, 3), camera to world; its columns are the camera's axes in the world."""
        return self.T_world_camera[:3, :3]

    @property
    def center(self) -> FloatArray:
        return self.T_world_camera[:3, 3]

    @property
    def focal_px(self) -> float:
        return float(np.sqrt(self.intrinsics.fx * self.intrinsics.fy))

    def in_camera(self, points_m: FloatArray) -> FloatArray:
        """(…, 3) world points in the camera's frame; the last coordinate is the depth."""
        local: FloatArray = (points_m - self.center) @ self.rotation
        return local

    def project(self, points_m: FloatArray) -> FloatArray:
        """(…, 3) world points to (…, 2) ideal pixels; NaN behind the camera."""
        local = self.in_camera(points_m)
        depth = np.where(local[..., 2:] > NEAREST_M, local[..., 2:], np.nan)
        xy: FloatArray = local[..., :2] / depth * self._focal + self._middle
        return xy

    def project_to_picture(self, points_m: FloatArray) -> FloatArray:
        """(n, 3) world points to (n, 2) pixels of the picture as it was taken; NaN behind the
        camera and outside of the lens's field."""
        return self.distort(self.project(points_m))

    def distort(self, ideal_xy: FloatArray) -> FloatArray:
        """(n, 2) ideal pixels to pixels of the picture as it was taken; NaN outside of the lens's
        field."""
        i = self.intrinsics
        if not i.distorted or not len(ideal_xy):
            return ideal_xy
        bent = lenses.bend((ideal_xy - self._middle) / self._focal, i.model, i.distortion)
        return np.asarray(bent * self._focal + self._middle)

    def undistort(self, picture_xy: FloatArray) -> FloatArray:
        """(n, 2) pixels of the picture to ideal pixels; NaN for what is outside of the lens's
        field."""
        i = self.intrinsics
        if not i.distorted or not len(picture_xy):
            return picture_xy
        straight = lenses.straighten(
            (picture_xy - self._middle) / self._focal, i.model, i.distortion
        )
        return np.asarray(straight * self._focal + self._middle)

    def rays(self, ideal_xy: FloatArray) -> FloatArray:
        """(…, 3) directions in the world through (…, 2) ideal pixels, scaled so that a step of 1 is
        a depth of 1."""
        plane = (ideal_xy - self._middle) / self._focal
        ones = np.ones((*plane.shape[:-1], 1))
        directions: FloatArray = np.concatenate([plane, ones], axis=-1) @ self.rotation.T
        return directions

    def sees(self, ideal_xy: FloatArray, margin_px: float = 0.0) -> BoolArray:
        """(…,) whether (…, 2) ideal pixels are in the picture as it was taken, ``margin_px`` away
        from its border."""
        size = np.array([self.intrinsics.width, self.intrinsics.height]) - 1
        xy = self.distort(ideal_xy.reshape(-1, 2)).reshape(ideal_xy.shape)
        inside: BoolArray = np.all((xy >= margin_px) & (xy <= size - margin_px), axis=-1)
        return inside

    @property
    def _focal(self) -> FloatArray:
        return np.array([self.intrinsics.fx, self.intrinsics.fy])

    @property
    def _middle(self) -> FloatArray:
        return np.array([self.intrinsics.cx, self.intrinsics.cy])


def check_pose(transform: FloatArray) -> None:
    """Raises CameraError unless (4, 4) ``transform`` is a rotation and a translation, to within
    rounding."""
    if transform.shape != (4, 4) or not np.isfinite(transform).all():
        raise CameraError("a pose is a 4 × 4 matrix of finite numbers")
    if np.abs(transform[3] - (0, 0, 0, 1)).max() > _ROTATION_TOLERANCE:
        raise CameraError("the last row of a pose is 0 0 0 1")
    rotation = transform[:3, :3]
    off = np.abs(rotation.T @ rotation - np.eye(3)).max()
    if off > _ROTATION_TOLERANCE or np.linalg.det(rotation) < 0:
        raise CameraError(
            "the upper left 3 × 3 of a pose is a rotation: orthonormal, determinant +1"
        )


def look_at(center: FloatArray, target: FloatArray, down: FloatArray) -> FloatArray:
    """(4, 4) pose of a camera at ``center`` that looks at ``target``; image y points along ``down``
    as nearly as it can. Raises CameraError when the camera would look along ``down``."""
    forward = target - center
    right = np.cross(down, forward)
    if np.linalg.norm(right) < 1e-9 * max(float(np.linalg.norm(forward)), 1e-9):
        raise CameraError("the camera looks along its own vertical")
    axes = [right, np.cross(forward, right), forward]
    pose = np.eye(4)
    pose[:3, :3] = np.stack([axis / np.linalg.norm(axis) for axis in axes], axis=1)
    pose[:3, 3] = center
    return pose


def epipolar_lines(first: Camera, second: Camera, ideal_xy: FloatArray) -> FloatArray:
    """(n, 3) lines ``a x + b y + c = 0`` (a² + b² = 1) in ``second`` on which (n, 2) ideal pixels
    of ``first`` lie.

    A point whose ray passes through the second camera's center has none: its line is NaN.
    """
    rotation = second.rotation.T @ first.rotation
    offset = second.rotation.T @ (first.center - second.center)
    plane = np.concatenate(
        [(ideal_xy - first._middle) / first._focal, np.ones((len(ideal_xy), 1))], axis=1
    )
    normals = np.cross(np.broadcast_to(offset, plane.shape), plane @ rotation.T)
    lines = normals @ np.linalg.inv(second.intrinsics.matrix)
    norm = np.hypot(lines[:, 0], lines[:, 1])[:, None]
    out: FloatArray = lines / np.where(norm > 1e-15, norm, np.nan)
    return out
