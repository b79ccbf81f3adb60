"""The DLO of a picture in meters on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import ModelUsed, PlanShapeRequest
from dlo_client.contracts.foreground import ReferenceUsed
from dlo_client.contracts.manipulation import MOST_STRETCH, in_another_unit
from dlo_client.contracts.on_table import FARTHEST_M, LEAST_LENGTH_M, LONGEST_M
from dlo_client.contracts.shape_plans import PlanWarning
from numpy.typing import NDArray

from models.geometry.polylines import arc_lengths, resample
from models.manipulation.dynamics import shape_distance
from models.manipulation.resampling import to_nodes
from workers.stages.foreground import Source
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.perception import perceive
from workers.stages.pictures import read_picture

FloatArray = NDArray[np.float64]
_MOST_POINTS = 1000
"""Of a state: as many as a request may hold have to fit."""
_SINGULAR = 1e-10
"""Determinant of a homography whose rows, for coordinates up to 1, are of length 1."""


@dataclass(frozen=True)
class Seen:
    """``points`` (N, 2) m in the target's order."""

    points: FloatArray
    warnings: list[PlanWarning]
    models: list[ModelUsed]
    reference: list[ReferenceUsed]


def state_from_image(request: PlanShapeRequest, tools: Tools) -> Seen:
    """The DLO whose length fits, when there are several, the longest where no length is known;
    which end is which is decided by the target, or by where a route starts.

    Raises InvalidInput: no DLO, or a homography that takes it to infinity.
    """
    if request.image is None:
        raise InvalidInput("image", "is missing: give state_m, or a picture beside the homography")
    assert request.homography is not None
    picture = read_picture(request.image, "image", tools, may_be_mask=request.model is None)
    perception = perceive(Source.of(picture), tools, request)
    lines = [
        to_table(i.centerline_xy, np.array(request.homography)) for i in perception.scene.instances
    ]
    if not lines:
        raise InvalidInput("image", "no DLO was found in it", "none_found")
    target = None if request.target_m is None else np.array(request.target_m)
    wanted = request.object.length_m or (None if target is None else float(arc_lengths(target)[-1]))
    lengths = np.array([arc_lengths(line)[-1] for line in lines])
    chosen = int(np.argmin(np.abs(np.log(np.maximum(lengths, 1e-9) / (wanted or lengths.max())))))
    warnings = [
        PlanWarning(code="picture", field="image", message=text) for text in picture.remarks
    ]
    if len(lines) > 1:
        text = f"{len(lines)} DLOs are in the picture; planned for the one {lengths[chosen]:.3f} m long"
        warnings.append(PlanWarning(code="other_dlo", field="image", message=text))
    points = lines[chosen]
    xy = perception.scene.instances[chosen].centerline_xy
    _check_scale(points, xy, np.array(request.homography), None if request.scale_target else wanted)
    if len(points) > _MOST_POINTS:
        points = resample(points, _MOST_POINTS)
    if _runs_backwards(request, points):
        points = points[::-1]
    return Seen(points, warnings, perception.models, perception.foreground.references)


def _runs_backwards(request: PlanShapeRequest, points: FloatArray) -> bool:
    if request.target_m is not None:
        nodes, goal = to_nodes(points), to_nodes(np.array(request.target_m))
        return bool(shape_distance(nodes[::-1], goal) < shape_distance(nodes, goal))
    assert request.route is not None
    assert request.route.start_m is not None
    away = np.hypot(*(points[[0, -1]] - np.array(request.route.start_m)).T)
    return bool(away[1] < away[0])


def to_table(xy: FloatArray, homography: FloatArray) -> FloatArray:
    """(N, 2) pixels to (N, 2) meters. The homography's scale is free."""
    size = np.diag([*np.maximum(np.abs(xy).max(axis=0), 1.0), 1.0])
    rows = np.linalg.norm(homography @ size, axis=1)
    if rows.min() == 0 or abs(np.linalg.det(homography @ size / rows[:, None])) < _SINGULAR:
        raise InvalidInput(
            "homography", "is singular: it takes the picture to a line", "invalid_homography"
        )
    mapped = np.column_stack([xy, np.ones(len(xy))]) @ (homography / rows[2]).T
    depth = np.abs(mapped[:, 2])
    if np.ptp(np.sign(mapped[:, 2])) or depth.min() < 1e-9 * depth.max():
        raise InvalidInput(
            "homography", "takes a part of the DLO behind the horizon", "invalid_homography"
        )
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def _check_scale(
    points: FloatArray, xy: FloatArray, homography: FloatArray, wanted_m: float | None
) -> None:
    """Raises InvalidInput for a homography that makes the DLO a length that none has, or that is
    far from the one that is wanted, with the likely mistake."""
    length = float(arc_lengths(points)[-1])
    fits = wanted_m is None or wanted_m / MOST_STRETCH <= length <= wanted_m * MOST_STRETCH
    if fits and LEAST_LENGTH_M <= length <= LONGEST_M and np.abs(points).max() <= FARTHEST_M:
        return
    backwards = to_table(xy, np.asarray(np.linalg.inv(homography), np.float64))
    if LEAST_LENGTH_M <= float(arc_lengths(backwards)[-1]) <= LONGEST_M:
        hint = "it seems to take the table to pixels; its inverse is needed"
    else:
        hint = f"is it to {in_another_unit(length)}, not to meters?"
    else_where = "" if wanted_m is None else f", the request speaks of {wanted_m:.3g} m"
    raise InvalidInput(
        "homography", f"makes the DLO {length:.4g} m long{else_where}: {hint}", "invalid_homography"
    )
