"""How the foreground of a picture is to be found: by which network, how hard, and what is known of
the place."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Point, Probability, Reply
from dlo_client.contracts.images import ImageSource

Effort = Annotated[
    Literal["fast", "normal", "thorough"],
    Field(
        description="how hard the foreground is looked for: `fast` sees the picture at three quarters of "
        "the network's size; `normal` at that size, and closer where strands are thin in a large picture; `thorough` "
        "at two sizes and mirrored, with the full network instead of its 8-bit form"
    ),
]
ModelName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_.-]{0,63}(@[1-9]\d{0,5})?$")]
"""A network of ``/v1/models``, or with ``@`` one version of it."""

Polygon = Annotated[list[Point], Field(min_length=3, max_length=500)]


class Regions(Contract):
    """Polygons in pixels of the upright picture: where cables can be, and where they never are."""

    only: list[Polygon] = Field(
        default_factory=list, max_length=50, description="pixels; cables are nowhere else"
    )
    never: list[Polygon] = Field(
        default_factory=list, max_length=50, description="pixels; there are no cables there"
    )

    @model_validator(mode="after")
    def _some(self) -> Regions:
        if not self.only and not self.never:
            raise ValueError("`regions` names no polygon: give `only`, `never` or both")
        return self


class ForegroundOptions(Contract):
    """Fields of every request that takes pictures."""

    model: ModelName | None = Field(
        default=None,
        description="foreground network, a name in /v1/models or `name@version`; default the best one",
    )
    default_model: ModelName | None = Field(
        default=None,
        description="network where `model` names none; unlike `model` it leaves a picture with two values a mask. The "
        "service fills in the one of the API key",
    )
    effort: Effort = "normal"
    reference: list[ImageSource] = Field(
        default_factory=list,
        max_length=16,
        description="pictures of the empty place by the same camera, of the picture's size; with `views` one a view",
    )
    regions: Regions | None = Field(
        default=None, description="where cables can be; with `views` in every picture"
    )

    @property
    def of_a_network(self) -> str | None:
        """A field that is given and has a meaning only for a picture that a network looks at."""
        return "model" if self.model is not None else "reference" if self.reference else None


class ReferenceUsed(Reply):
    """What the pictures of the empty place were worth for one picture."""

    used: bool = Field(
        description="off: they could not be brought to the picture; then they changed nothing"
    )
    agreement: Probability = Field(
        description="share of the picture that looks as in the reference"
    )
    relied: Probability = Field(
        description="how much of the answer rests on it: mean change of probability where the network or the answer "
        "sees cable"
    )
    shift_px: float = Field(
        ge=0, description="how far the camera had moved, in the middle of the picture"
    )
    reason: str | None = Field(default=None, description="why they were not used")


ReferencesUsed = Annotated[
    list[ReferenceUsed],
    Field(
        description="what the request's `reference` was worth, one a picture; none when there was no reference"
    ),
]
