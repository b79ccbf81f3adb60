"""The instance methods and what can be set for each. ``method`` inside parameters states whose they
are: a request's ``params`` may leave it out, they are those of the request's own ``method``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from dlo_client.contracts.base import Contract

InstanceMethod = Literal["section_matching", "rt_dlo", "fastdlo", "ariadne_plus"]
DEFAULT_METHOD: InstanceMethod = "section_matching"


class SectionMatchingParams(Contract):
    """Parameters of the default method: sections of the skeleton, matched jointly."""

    method: Literal["section_matching"] = Field(
        default="section_matching", description="whose parameters these are"
    )
    hole_widths: float = Field(
        default=0.7,
        ge=0,
        le=4,
        description="holes up to this area are filled, in squared typical widths",
    )
    gap_widths: float = Field(
        default=20.0, ge=0, le=50, description="longest gap to bridge, in typical widths"
    )
    stop_cost: float = Field(
        default=3.0,
        ge=-5,
        le=20,
        description="cost, in log odds, of a DLO that ends where others cross",
    )


class RtDloParams(Contract):
    """Parameters of RT-DLO (thesis section 3.5, Table 3.5)."""

    method: Literal["rt_dlo"] = Field(default="rt_dlo", description="whose parameters these are")
    sampling_ratio: float = Field(
        default=0.15, gt=0, le=1, description="alpha: share of maxima kept as vertices"
    )
    neighbors: int = Field(
        default=8, ge=2, le=64, description="K_nn: how many neighbors a vertex has"
    )
    min_similarity: float = Field(default=0.1, ge=0, lt=1, description="mu: weakest edge accepted")


class FastDloParams(Contract):
    """Parameters of FASTDLO (thesis section 3.4)."""

    method: Literal["fastdlo"] = Field(default="fastdlo", description="whose parameters these are")
    min_probability: float = Field(
        default=1e-4, ge=0, lt=1, description="t_c: least probability of a connection"
    )


class AriadnePlusParams(Contract):
    """Parameters of Ariadne+ (thesis section 3.3)."""

    method: Literal["ariadne_plus"] = Field(
        default="ariadne_plus", description="whose parameters these are"
    )
    superpixels: int = Field(
        default=50, ge=2, le=400, description="into how many the foreground is cut at most"
    )


MethodParams = Annotated[
    SectionMatchingParams | RtDloParams | FastDloParams | AriadnePlusParams,
    Field(discriminator="method"),
]
