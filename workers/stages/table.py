"""The DLO of a picture in meters on the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import ModelUsed, PlanShapeRequest
from dlo_client.contracts.manipulation import PlanWarning
from numpy.typing import NDArray

from models.geometry.polylines import arc_lengths
from models.manipulation.dynamics import shape_distance
from models.manipulation.resampling import to_nodes
from workers.stages.foreground import Source
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.perception import perceive
from workers.stages.pictures import read_picture

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Seen:
    """``points`` (N, 2) m in the target's order."""

    points: FloatArray
    warnings: list[PlanWarning]
    models: list[ModelUsed]


def state_from_image(request: PlanShapeRequest, target: FloatArray, tools: Tools) -> Seen:
    """The DLO whose length fits, when there are several; which end is which is decided by the target.

    Raises InvalidInput: no DLO, or a homography that takes it to infinity.
    """
    if request.image is None:
        raise InvalidInput("image", "is missing: give state_m, or a picture beside the homography")
    assert request.homography is not None
    picture = read_picture(request.image, "image", tools, may_be_mask=request.model is None)
    perception = perceive(Source.of(picture), tools, model=request.model)
    lines = [to_table(i.centerline_xy, np.array(request.homography)) for i in perception.scene.instances]
    if not lines:
        raise InvalidInput("image", "no DLO was found in it", "none_found")
    wanted = request.object.length_m or float(arc_lengths(target)[-1])
    lengths = np.array([arc_lengths(line)[-1] for line in lines])
    chosen = int(np.argmin(np.abs(np.log(np.maximum(lengths, 1e-9) / wanted))))
    warnings = [PlanWarning(code="picture", field="image", message=text) for text in picture.remarks]
    if len(lines) > 1:
        text = f"{len(lines)} DLOs are in the picture; planned for the one {lengths[chosen]:.3f} m long"
        warnings.append(PlanWarning(code="other_dlo", field="image", message=text))
    points = lines[chosen]
    nodes, goal = to_nodes(points), to_nodes(target)
    if shape_distance(nodes[::-1], goal) < shape_distance(nodes, goal):
        points = points[::-1]
    return Seen(points, warnings, perception.models)


def to_table(xy: FloatArray, homography: FloatArray) -> FloatArray:
    """(N, 2) pixels to (N, 2) meters."""
    if abs(np.linalg.det(homography)) < 1e-15:
        raise InvalidInput("homography", "is singular: it takes the picture to a line", "invalid_homography")
    mapped = np.column_stack([xy, np.ones(len(xy))]) @ homography.T
    if np.ptp(np.sign(mapped[:, 2])) or np.abs(mapped[:, 2]).min() < 1e-12:
        raise InvalidInput("homography", "takes a part of the DLO behind the horizon", "invalid_homography")
    return np.asarray(mapped[:, :2] / mapped[:, 2:])
