"""Our own label format: one JSON file a picture that loses nothing of what the service said."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from dlo_client.contracts import (
    Crossing,
    Endpoint,
    InstancesResult,
    MaskRLE,
    ModelUsed,
    Point,
    Probability,
    Spline,
)
from dlo_client.contracts.base import Reply

NO_INSTANCES = 0.0
"""Certainty of a picture in which nothing was found: somebody should look at it."""


class LabelledInstance(Reply):
    """One DLO of a labelled picture. What a person or another tool drew has no score, and may lack
    a centerline (a mask alone) or its ends."""

    id: int = Field(ge=1, description="its value in indexed masks while it is at most 255")
    score: Probability | None = Field(
        default=None, description="the service's confidence; none for a person's work"
    )
    centerline_xy: list[Point] = Field(default_factory=list)
    width_px: float | None = Field(default=None, gt=0)
    closed: bool = False
    mask_rle: MaskRLE
    spline: Spline | None = None
    endpoints: list[Endpoint] = Field(default_factory=list)
    length_px: float | None = None


class PictureLabel(Reply):
    """The label of one picture. ``name`` is its path in the source, with ``/``; sizes are of the
    upright picture."""

    format: Literal["dlo-label/1"] = "dlo-label/1"
    name: str
    sha256: str | None = Field(default=None, description="of the picture's bytes")
    width: int = Field(gt=0)
    height: int = Field(gt=0)
    instances: list[LabelledInstance]
    crossings: list[Crossing] = Field(default_factory=list)
    ignore: list[list[Point]] = Field(
        default_factory=list, description="polygons in which nothing is labelled"
    )
    connectors: list[list[Point]] = Field(
        default_factory=list, description="polygons around those of a harness"
    )
    branch_points: list[Point] = Field(
        default_factory=list, description="where cables of a harness branch"
    )
    origin: Literal["service", "corrected", "tracked"] = "service"
    method: str | None = None
    threshold: float | None = None
    models: list[ModelUsed] = Field(default_factory=list)

    @property
    def certainty(self) -> float:
        """0 to 1: the lowest of all scores; 0 where nothing was found."""
        scores = [i.score for i in self.instances if i.score is not None] + [
            c.score for c in self.crossings
        ]
        if not self.instances:
            return NO_INSTANCES
        return min(scores, default=1.0)

    @property
    def doubt(self) -> str:
        """In words, what the certainty comes from."""
        if not self.instances:
            return "nothing was found"
        scored = [
            (i.score, f"instance {i.id} has score {i.score:.2f}")
            for i in self.instances
            if i.score is not None
        ]
        scored += [
            (c.score, f"the order at crossing {c.id} has score {c.score:.2f}")
            for c in self.crossings
        ]
        return min(scored, default=(1.0, ""))[1]


def label_of(result: InstancesResult, name: str, sha256: str | None = None) -> PictureLabel:
    """What the service answered, as a label."""
    return PictureLabel(
        name=name,
        sha256=sha256,
        width=result.width,
        height=result.height,
        instances=[LabelledInstance.model_validate(i.model_dump()) for i in result.instances],
        crossings=result.crossings,
        method=result.method,
        threshold=result.threshold,
        models=result.models,
    )
