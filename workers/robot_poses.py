"""The places of a result as robot poses: found in the result, brought to a frame, written in a
convention.

Strategy: every place is first a pose in the world (x along the DLO, z into the surface), whatever
the result is in: points of space are taken as they are; pixels are carried along their rays to the
plane that the DLOs are on; points of a table are put on that plane. Then all places go the same way
to the frame, to the flange, to the maker's numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from dlo_client.contracts import (
    DisentangleResult,
    InstancesResult,
    MergeCurvesResult,
    PlanShapeResult,
    ReconstructResult,
    TopologyResult,
)
from dlo_client.contracts.frames import Output, Plane, RobotPose, RobotPoses

from models.geometry.arrays import FloatArray
from models.geometry.cameras import Camera
from workers import rotations
from workers.stages import curves3d

Role = Literal["first", "middle", "last", "hold", "pick", "place"]
_LEAST_SLOPE = 0.02
"""Sine of the flattest angle at which a ray still meets the plane at a place that means
anything."""
_AHEAD_PX = 4.0


@dataclass(frozen=True)
class Place:
    """``pose`` (4, 4) in the world, meters."""

    role: Role
    id: int
    pose: FloatArray
    score: float = 1.0


class _NowhereError(Exception):
    """A pixel that sees no place of the plane."""


def robot_poses(output: Output, result: Any, *, in_camera: bool = False) -> RobotPoses:
    """The places of ``result`` as ``output`` has them; what cannot be placed is named in the
    warnings.

    ``in_camera``: curves that depth gave are in the camera's frame, as the request does not place
    it in the world.
    """
    warnings: list[str] = []
    places = list(_places(output, result, warnings, _of_curves(output, in_camera)))
    to_frame = np.linalg.inv(_frame(output, result))
    from_tool = (
        np.eye(4) if output.T_flange_tool is None else np.linalg.inv(np.array(output.T_flange_tool))
    )
    poses = []
    for place in places:
        pose = to_frame @ place.pose @ from_tool
        poses.append(
            RobotPose(
                role=place.role,
                id=place.id,
                position=rotations.position(pose, output.unit),
                rotation=rotations.written(pose[:3, :3], output.rotation),
                score=place.score,
            )
        )
    of: Literal["tool", "flange"] = "tool" if output.T_flange_tool is None else "flange"
    return RobotPoses(
        frame=output.frame,
        unit=output.unit,
        rotation=output.rotation,
        of=of,
        poses=poses,
        warnings=warnings,
    )


def _frame(output: Output, result: Any) -> FloatArray:
    """(4, 4) of the wanted frame in the world."""
    if output.T_world_frame is not None:
        return np.array(output.T_world_frame)
    if output.frame != "camera":
        return np.eye(4)
    if isinstance(result, ReconstructResult):
        return np.array(result.views[0].T_world_camera)
    assert output.camera is not None  # checked with the request
    return np.array(output.camera.T_world_camera)


def _of_curves(output: Output, in_camera: bool) -> FloatArray:
    """(4, 4) that takes curves of depth to the world."""
    return (
        np.array(output.camera.T_world_camera)
        if in_camera and output.camera is not None
        else np.eye(4)
    )


def _places(
    output: Output, result: Any, warnings: list[str], to_world: FloatArray
) -> Iterator[Place]:
    match result:
        case ReconstructResult():
            for number, curve in enumerate(
                [result.curve, *(other.curve for other in result.others)], start=1
            ):
                yield from _of_curve(np.array(curve.points_m), number, 1.0, output.plane)
        case MergeCurvesResult():
            yield from _of_curve(np.array(result.curve.points_m), 1, 1.0, output.plane)
        case InstancesResult():
            lines = [
                (i.id, i.score, i.centerline_xy, getattr(i, "curve_m", None))
                for i in result.instances
            ]
            yield from _of_lines(lines, output, warnings, to_world)
        case TopologyResult():
            lines = [
                (s.id, s.score, s.points_xy, getattr(s, "curve_m", None)) for s in result.sections
            ]
            yield from _of_lines(lines, output, warnings, to_world)
        case DisentangleResult():
            yield from _of_turn(output, result, warnings)
        case PlanShapeResult():
            yield from _of_move(output.plane, result)


def _of_lines(
    lines: Sequence[tuple[int, float, Any, Any]],
    output: Output,
    warnings: list[str],
    to_world: FloatArray,
) -> Iterator[Place]:
    """Three places a line: from its curve in space where depth gave one, else from its pixels."""
    for number, score, pixels, curve_m in lines:
        try:
            if curve_m is None:
                points = _on_plane(_camera(output), output.plane, np.array(pixels, np.float64))
            else:
                points = np.array(curve_m, np.float64) @ to_world[:3, :3].T + to_world[:3, 3]
            yield from _of_curve(points, number, score, output.plane)
        except _NowhereError as error:
            warnings.append(f"{number}: {error}")


def _of_curve(points_m: FloatArray, number: int, score: float, plane: Plane) -> Iterator[Place]:
    """First, middle (by arc length) and last of (n, 3) points in the world."""
    steps = np.linalg.norm(np.diff(points_m, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    reach = max(along[-1] * 0.02, 1e-6)
    roles: tuple[tuple[Role, float], ...] = (
        ("first", 0.0),
        ("middle", along[-1] / 2),
        ("last", along[-1]),
    )
    for role, at in roles:
        place, before, after = (_at(points_m, along, at + step) for step in (0.0, -reach, reach))
        yield Place(role, number, _pose(place, after - before, plane), score)


def _of_turn(output: Output, result: DisentangleResult, warnings: list[str]) -> Iterator[Place]:
    if not result.actions:
        return
    best = result.actions[0]
    grips: tuple[tuple[Role, Any], ...] = (
        ("hold", best.hold),
        ("pick", best.pick),
        ("place", best.place),
    )
    try:
        for role, grip in grips:
            ahead = _AHEAD_PX * np.array([np.cos(grip.angle_rad), np.sin(grip.angle_rad)])
            pair = _on_plane(
                _camera(output), output.plane, np.array([grip.xy, np.array(grip.xy) + ahead])
            )
            yield Place(
                role, best.section, _pose(pair[0], pair[1] - pair[0], output.plane), best.score
            )
    except _NowhereError as error:
        warnings.append(f"the action: {error}")


def _of_move(plane: Plane, result: PlanShapeResult) -> Iterator[Place]:
    """The table's x and y are the world's; the height is that of the plane there."""
    if result.action is None:
        return
    normal, offset = _normal(plane)
    grips: tuple[tuple[Role, Any], ...] = (
        ("pick", result.action.pick),
        ("place", result.action.place),
    )
    for role, grip in grips:
        x, y = grip.xy_m
        z = (
            (offset - normal[0] * x - normal[1] * y) / normal[2]
            if abs(normal[2]) > _LEAST_SLOPE
            else 0.0
        )
        along = np.array([np.cos(grip.angle_rad), np.sin(grip.angle_rad), 0.0])
        yield Place(role, result.action.edge, _pose(np.array([x, y, z]), along, plane))


def _camera(output: Output) -> Camera:
    if output.camera is None:  # there was depth, but none for this DLO
        raise _NowhereError("is seen in pixels only, and the output names no camera")
    return curves3d.camera(output.camera, "output.camera")


def _on_plane(camera: Camera, plane: Plane, picture_xy: FloatArray) -> FloatArray:
    """(n, 2) pixels to (n, 3) points of the plane; raises _NowhereError where rays miss it."""
    rays = camera.rays(camera.undistort(picture_xy))
    normal, offset = _normal(plane)
    slope = rays @ normal
    away = offset - camera.center @ normal
    flat = np.abs(slope) < _LEAST_SLOPE * np.linalg.norm(rays, axis=1)
    if not np.isfinite(rays).all() or flat.any() or (away * slope <= 0).any():
        raise _NowhereError("is not on the plane, as the camera sees it")
    return np.asarray(camera.center + rays * (away / slope)[:, None])


def _normal(plane: Plane) -> tuple[FloatArray, float]:
    given = np.array(plane.normal)
    return given / np.linalg.norm(given), plane.offset_m


def _at(points: FloatArray, along: FloatArray, distance: float) -> FloatArray:
    return np.array([np.interp(distance, along, points[:, axis]) for axis in range(3)])


def _pose(place: FloatArray, along: FloatArray, plane: Plane) -> FloatArray:
    """(4, 4): x along the DLO, z against the plane's normal as nearly as x allows."""
    up = _normal(plane)[0]
    x = along / max(float(np.linalg.norm(along)), 1e-12)
    z = -(up - (up @ x) * x)
    if (
        np.linalg.norm(z) < 1e-6
    ):  # the DLO stands upright on the plane: any approach across it is as good
        side = np.eye(3)[int(np.argmin(np.abs(x)))]
        z = side - (side @ x) * x
    z /= np.linalg.norm(z)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    pose[:3, 3] = place
    return pose
