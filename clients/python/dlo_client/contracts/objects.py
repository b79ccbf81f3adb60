"""What the service sees in a picture: DLO instances and their crossings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from dlo_client.contracts.base import Point, Probability, Reply

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Spline(Reply):
    """B-spline of the centerline: ``len(knots) == len(control_xy) + degree + 1``, parameter 0 to 1."""

    degree: int = Field(ge=1, le=5)
    knots: list[float]
    control_xy: list[Point]


class Endpoint(Reply):
    """Where a DLO ends: ``free`` in view, ``border`` at the picture's edge, ``hidden`` under another DLO."""

    xy: Point
    kind: Literal["free", "border", "hidden"]


class MaskRLE(Reply):
    """COCO compressed run-length mask; ``size`` is ``(height, width)``, runs go down the columns."""

    size: tuple[int, int]
    counts: str

    def array(self) -> NDArray[np.bool_]:
        """(height, width), True where the mask is. Needs NumPy; raises ValueError for runs that are no mask."""
        from dlo_client.arrays import mask_array  # NumPy is no requirement of the contracts

        return mask_array(self.counts, self.size)


Reason = Literal["gap", "border", "parallel", "low_contrast", "blur"]
"""Why an answer is unsure: foreground is missing along the way (``gap``); it ends at the picture's edge near another
one (``border``); it runs along another one without background between (``parallel``); the picture hardly tells it
from what lies beside it (``low_contrast``); its edges are not sharp (``blur``)."""


class SceneStatus(Reply):
    """Whether the whole answer can be relied on. ``unsure``: some instance or crossing is less likely right than
    ``limit``; ``none_found``: no DLO was seen. ``reasons`` are those of all unsure instances, most frequent first."""

    code: Literal["ok", "unsure", "none_found"]
    limit: Probability
    reasons: list[Reason]


class Instance(Reply):
    """One DLO as it appears in the picture."""

    id: int = Field(ge=1, description="also its value in instances.png")
    score: Probability = Field(
        description="probability that it matches one true DLO above IoU 0.5; calibrated on rendered scenes"
    )
    reasons: list[Reason] = Field(default=[], description="what makes it unsure; may be empty")
    centerline_xy: list[Point] = Field(description="ordered, at equal arc length, end to end")
    width_px: float = Field(gt=0)
    length_px: float = Field(ge=0)
    closed: bool = Field(description="the centerline is a ring; it then has no endpoints")
    spline: Spline
    endpoints: list[Endpoint]
    mask_rle: MaskRLE = Field(description="visible pixels: at a crossing the upper DLO owns them")


class StrandPosition(Reply):
    """A place on an instance: ``u`` from 0 at the first to 1 at the last centerline point, by arc length."""

    instance: int = Field(ge=1)
    u: Probability


class Crossing(Reply):
    """Where one strand passes over another; both may belong to the same instance (a self-crossing)."""

    id: int = Field(ge=1)
    xy: Point
    over: StrandPosition
    under: StrandPosition
    score: Probability = Field(
        description="probability that the order is right; 0.5 when it is not known (no picture, no difference seen)"
    )
    existence: Probability = Field(default=1.0, description="probability that two strands cross here at all")
