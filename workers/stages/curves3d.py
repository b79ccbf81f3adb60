"""Cameras and 3D curves between contracts and arrays."""

from __future__ import annotations

import csv
import io

import numpy as np
from dlo_client.contracts import CameraInfo, CameraPose, Curve3D, NextView, Spline3
from dlo_client.contracts.cameras import AnyIntrinsics, Pose
from numpy.typing import NDArray

from models.geometry.cameras import Camera, CameraError, Intrinsics
from models.reconstruction.curves import DEGREE, Curve, Spline3D
from models.reconstruction.view_planning import Plan
from workers.stages.outcome import InvalidInput

_MICROMETERS = 6
_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


def camera(given: CameraPose, field: str) -> Camera:
    """Raises InvalidInput naming ``field``."""
    try:
        return Camera(_intrinsics(given.intrinsics), np.array(given.T_world_camera, np.float64))
    except CameraError as error:
        raise InvalidInput(field, str(error), "invalid_camera") from error


def pose(transform: NDArray[np.float64]) -> Pose:
    rows = np.round(transform, 9).tolist()
    return tuple(tuple(row) for row in rows)  # type: ignore[return-value]


def next_view(plan: Plan) -> NextView:
    return NextView(
        baseline_m=round(plan.baseline_m, 6),
        delta_z_m=round(plan.delta_z_m, 6),
        T_world_camera=[pose(planned) for planned in plan.poses],
        sigma_m=float(f"{plan.sigma_m:.4g}"),
        expected_sigma_m=float(f"{plan.expected_sigma_m:.4g}"),
        gain=round(plan.gain, 4),
        visible=round(plan.visible, 4),
    )


def encode(curve: Curve) -> Curve3D:
    known = np.isfinite(curve.mean_radius_m)
    return Curve3D(
        points_m=_points(curve.points_m),
        covariance_m2=[
            tuple(float(f"{c[i, j]:.4g}") for i, j in _UPPER) for c in curve.covariance_m2
        ],
        sigma_m=[float(f"{s:.4g}") for s in curve.sigma_m],
        spline=Spline3(
            degree=DEGREE,
            knots=[round(float(k), 6) for k in curve.spline.knots],
            control_m=_points(curve.spline.control_m),
        ),
        radius_m=round(curve.mean_radius_m, _MICROMETERS) if known else None,
        radius_sigma_m=round(curve.radius_sigma_m, _MICROMETERS)
        if np.isfinite(curve.radius_sigma_m)
        else None,
        length_m=round(curve.length_m, _MICROMETERS),
    )


def decode(given: Curve3D, field: str) -> Curve:
    """Raises InvalidInput naming ``field`` for a spline that is not cubic or a covariance that is
    none."""
    if given.spline.degree != DEGREE:
        raise InvalidInput(
            f"{field}.spline.degree", f"is {given.spline.degree}; curves are cubic", "invalid_curve"
        )
    covariance = np.zeros((len(given.covariance_m2), 3, 3))
    for column, (i, j) in enumerate(_UPPER):
        covariance[:, i, j] = covariance[:, j, i] = [row[column] for row in given.covariance_m2]
    values = np.linalg.eigvalsh(covariance)
    if (values[:, 0] < -1e-3 * np.maximum(values[:, -1], 1e-12)).any():
        raise InvalidInput(f"{field}.covariance_m2", "has a negative variance", "invalid_curve")
    points = np.array(given.points_m, np.float64)
    radius = np.nan if given.radius_m is None else given.radius_m
    sigma = np.nan if given.radius_sigma_m is None else given.radius_sigma_m
    spline = Spline3D(np.array(given.spline.knots), np.array(given.spline.control_m, np.float64))
    return Curve(spline, points, covariance, np.full(len(points), radius), sigma)


def csv_file(curves: list[Curve]) -> tuple[str, bytes]:
    """A row a point: curve (0 the target), x, y, z, radius, sigma in meters; a radius that is not
    known is empty."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(["curve", "x_m", "y_m", "z_m", "radius_m", "sigma_m"])
    for number, curve in enumerate(curves):
        for point, sigma in zip(curve.points_m, curve.sigma_m, strict=True):
            radius = f"{curve.mean_radius_m:.6f}" if np.isfinite(curve.mean_radius_m) else ""
            rows.writerow([number, *(f"{v:.6f}" for v in point), radius, f"{sigma:.6f}"])
    return "text/csv", text.getvalue().encode()


def ply_file(curves: list[Curve]) -> tuple[str, bytes]:
    """ASCII PLY: vertices with radius and sigma, and edges that join the vertices of a curve."""
    counts = [len(c.points_m) for c in curves]
    head = [
        "ply",
        "format ascii 1.0",
        "comment meters; curve 0 is the target; radius 0 is not known",
        f"element vertex {sum(counts)}",
        *(f"property float {name}" for name in ("x", "y", "z", "radius", "sigma")),
        "property int curve",
        f"element edge {sum(counts) - len(counts)}",
        "property int vertex1",
        "property int vertex2",
        "end_header",
    ]
    vertices, edges, first = [], [], 0
    for number, curve in enumerate(curves):
        for point, sigma in zip(curve.points_m, curve.sigma_m, strict=True):
            x, y, z = point
            radius = np.nan_to_num(curve.mean_radius_m, nan=0.0)
            vertices.append(f"{x:.6f} {y:.6f} {z:.6f} {radius:.6f} {sigma:.6f} {number}")
        edges += [f"{k} {k + 1}" for k in range(first, first + len(curve.points_m) - 1)]
        first += len(curve.points_m)
    return "application/octet-stream", "\n".join([*head, *vertices, *edges, ""]).encode()


def _intrinsics(given: AnyIntrinsics) -> Intrinsics:
    i = given.as_taken() if isinstance(given, CameraInfo) else given
    return Intrinsics(i.width, i.height, i.fx, i.fy, i.cx, i.cy, tuple(i.distortion), i.lens)


def _points(xyz: NDArray[np.float64]) -> list[tuple[float, float, float]]:
    return [(x, y, z) for x, y, z in np.round(xyz, _MICROMETERS).tolist()]
