"""What the service sees in a picture: DLO instances and their crossings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from dlo_client.contracts.base import Point, Probability, Reply
from dlo_client.contracts.depth import MetricCenterline

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Spline(Reply):
    """B-spline of the centerline: ``len(knots) == len(control_xy) + degree + 1``, parameter 0 to
    1."""

    degree: int = Field(ge=1, le=5, description="of its polynomials")
    knots: list[float] = Field(description="0 to 1, not decreasing")
    control_xy: list[Point] = Field(description="control points, pixels")


class Endpoint(Reply):
    """Where a DLO ends: ``free`` in view, ``border`` at the picture's edge, ``hidden`` under
    another DLO."""

    xy: Point = Field(description="its place, pixels")
    kind: Literal["free", "border", "hidden"] = Field(
        description="`free` in view, `border` at the picture's edge, `hidden` under another DLO"
    )


class MaskRLE(Reply):
    """COCO compressed run-length mask; ``size`` is ``(height, width)``, runs go down the
    columns."""

    size: tuple[int, int] = Field(description="height and width of the picture, pixels")
    counts: str = Field(
        description="run lengths, down the columns, as pycocotools writes and reads them"
    )

    def array(self) -> NDArray[np.bool_]:
        """(height, width), True where the mask is. Needs NumPy; raises ValueError for runs that are
        no mask."""
        from dlo_client.arrays import mask_array  # NumPy is no requirement of the contracts

        return mask_array(self.counts, self.size)


Reason = Literal[
    "gap",
    "border",
    "parallel",
    "low_contrast",
    "blur",
    "lookalike",
    "free_ends",
    "short",
    "odd_width",
    "no_picture",
    "crossing",
    "order",
]
"""Why an answer is unsure: foreground is missing along the way (``gap``); it ends at the picture's
edge near another one (``border``); it runs along another one without background between
(``parallel``); the picture hardly tells it from what is beside it (``low_contrast``); its edges
are not sharp (``blur``); it may be something else of that shape (``lookalike``); no end of it is at
the border, so it may be a piece of a longer one (``free_ends``); it is short beside the others
(``short``) or of another width (``odd_width``); there is a mask only (``no_picture``). Of the whole
answer also: whether two cross is unsure (``crossing``), or which of them is on top (``order``)."""


class SceneStatus(Reply):
    """Whether the whole answer can be relied on. ``unsure``: some instance or crossing is less
    likely right than ``limit``; ``none_found``: no DLO was seen. ``reasons`` are those of all
    unsure instances and crossings, most frequent first."""

    code: Literal["ok", "unsure", "none_found"] = Field(
        description="`ok`, `unsure` or `none_found`"
    )
    limit: Probability = Field(description="score below which an instance or crossing is unsure")
    reasons: list[Reason] = Field(description="of all that is unsure, most frequent first")


class Instance(MetricCenterline):
    """One DLO as it appears in the picture."""

    id: int = Field(ge=1, description="from 1; also its value in instances.png")
    score: Probability = Field(
        description="probability that it matches one true DLO above IoU 0.5; calibrated on rendered scenes"
    )
    reasons: list[Reason] = Field(default=[], description="what makes it unsure; may be empty")
    centerline_xy: list[Point] = Field(description="ordered, at equal arc length, end to end")
    width_px: float = Field(gt=0, description="mean over the visible part")
    length_px: float = Field(ge=0, description="arc length of the centerline")
    closed: bool = Field(description="the centerline is a ring; it then has no endpoints")
    spline: Spline = Field(description="the centerline as a B-spline")
    endpoints: list[Endpoint] = Field(
        description="at the first and at the last point; none of a ring"
    )
    mask_rle: MaskRLE = Field(description="visible pixels: at a crossing the upper DLO owns them")


class StrandPosition(Reply):
    """A place on an instance: ``u`` from 0 at the first to 1 at the last centerline point, by arc
    length."""

    instance: int = Field(ge=1, description="its id")
    u: Probability = Field(
        description="share of the arc length: 0 at its first to 1 at its last point"
    )


class Crossing(Reply):
    """Where one strand passes over another; both may belong to the same instance (a
    self-crossing)."""

    id: int = Field(ge=1, description="from 1, in the order of the list")
    xy: Point = Field(description="where the centerlines meet, pixels")
    over: StrandPosition = Field(description="the strand on top")
    under: StrandPosition = Field(description="the strand below")
    score: Probability = Field(
        description="probability that the order is right; 0.5 when it is not known (no picture, no difference seen)"
    )
    existence: Probability = Field(
        default=1.0, description="probability that two strands cross here at all"
    )
