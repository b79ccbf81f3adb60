"""Kinds of thesis chapter 4: the 3D shape of DLOs from a camera that moves."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Point, Probability, Reply
from dlo_client.contracts.cameras import AnyIntrinsics, CameraPose, CameraView, Pose
from dlo_client.contracts.foreground import ForegroundOptions, ReferencesUsed
from dlo_client.contracts.submission import JobRequest, ModelUsed

Coordinate = Annotated[float, Field(ge=-1e4, le=1e4)]
Point3 = tuple[Coordinate, Coordinate, Coordinate]
"""``(x, y, z)`` in meters in the world."""

_Entry = Annotated[float, Field(ge=-1e8, le=1e8)]
Covariance = tuple[_Entry, _Entry, _Entry, _Entry, _Entry, _Entry]
"""``xx, xy, xz, yy, yz, zz`` in square meters."""
Sigma = Annotated[float, Field(ge=0, le=1e4)]

ReconstructMethod = Literal["spline_bundle", "dlo3ds"]
ReconstructFile = Literal["curve", "overlay"]
Optimise = Literal["fixed", "b", "z", "bz"]
CurveEnd = Literal["free", "border"]
"""``border``: at the edge of a picture, the DLO may go on; ``free``: it ends in view, or is hidden
from there on."""
_SAME_PLACE_M = 1e-4
_AT_THE_END = 1e-3
_SHORTEST_M = 1e-6
"""Of a curve: what the coordinates are rounded to."""
MOST_POINTS = 5000
_MOST_MERGED = 40_000
"""Points of all sections together: the cost of merging grows with their square where they lie
close."""


class Spline3(Reply):
    """Clamped B-spline of the centerline, parameter 0 to 1: ``len(knots) == len(control_m) + degree
    + 1``."""

    degree: int = Field(ge=1, le=5, description="of its polynomials")
    knots: list[Annotated[float, Field(ge=-0.01, le=1.01)]] = Field(
        max_length=600, description="0 to 1, not decreasing"
    )
    control_m: list[Point3] = Field(
        min_length=2, max_length=500, description="control points in the world, meters"
    )

    @model_validator(mode="after")
    def _consistent(self) -> Spline3:
        if len(self.knots) != len(self.control_m) + self.degree + 1:
            raise ValueError("`knots` are as many as len(control_m) + degree + 1")
        if any(b < a for a, b in pairwise(self.knots)):
            raise ValueError("`knots` do not decrease")
        ends = self.knots[: self.degree + 1] + [1 - k for k in self.knots[-self.degree - 1 :]]
        if max(map(abs, ends)) > _AT_THE_END:
            raise ValueError(
                "`knots` begin with degree + 1 times 0 and end with degree + 1 times 1"
            )
        inner = self.knots[1:-1]
        if any(b <= a for a, b in zip(inner, inner[self.degree :], strict=False)):
            raise ValueError(
                "`knots` between the ends are repeated up to degree times: the curve would break"
            )
        return self


class Curve3D(Reply):
    """One DLO as a curve in the world, with what is known about its errors.

    The covariance is that of the position across the curve; how far along it a point is, is a
    matter of convention.
    """

    points_m: list[Point3] = Field(
        min_length=2, max_length=MOST_POINTS, description="ordered, at equal arc length"
    )
    covariance_m2: list[Covariance] = Field(
        max_length=MOST_POINTS, description="one a point, across the curve"
    )
    sigma_m: list[Sigma] = Field(
        max_length=MOST_POINTS, description="one a point: standard deviation in its worst direction"
    )
    spline: Spline3 = Field(description="the same curve as a B-spline")
    radius_m: Sigma | None = Field(
        default=None, description="median along the DLO; None if not known"
    )
    radius_sigma_m: Sigma | None = Field(
        default=None, description="standard deviation of `radius_m`"
    )
    length_m: float = Field(ge=0, le=1e9, description="arc length")

    @model_validator(mode="after")
    def _one_each(self) -> Curve3D:
        if not len(self.points_m) == len(self.covariance_m2) == len(self.sigma_m):
            raise ValueError("`covariance_m2` and `sigma_m` have one entry for each of `points_m`")
        if sum(math.dist(a, b) for a, b in pairwise(self.points_m)) < _SHORTEST_M:
            raise ValueError("`points_m` holds one place only")
        return self


class Target(Contract):
    """Which DLO: the one nearest to a pixel of a view, or an instance of the view by its id."""

    view: int = Field(ge=0, lt=64, description="index into `views`")
    xy: Point | None = Field(default=None, description="a pixel on the DLO")
    instance: int | None = Field(default=None, ge=1, description="id of the DLO in that view")

    @model_validator(mode="after")
    def _one_of_both(self) -> Target:
        if (self.xy is None) == (self.instance is None):
            raise ValueError("give either xy or instance")
        return self


class ViewOutcome(Reply):
    """What became of a view. ``used``: it took part. ``dropped``: nothing was found in it, or
    nothing that fits."""

    name: str = Field(description="of the view")
    status: Literal["used", "dropped"] = Field(description="whether it took part")
    reason: str | None = Field(default=None, description="why it was dropped")
    instances_found: int = Field(ge=0, description="how many DLOs were seen in this picture")
    instance: int | None = Field(
        default=None, description="id, in this view, of the DLO that `curve` describes"
    )
    reprojection_px: float | None = Field(
        default=None, description="mean distance of `curve` to its centerline here"
    )
    share: Probability = Field(
        description="of the curve's samples in this picture that lie on the centerline"
    )
    intrinsics: AnyIntrinsics = Field(description="as in the request")
    T_world_camera: Pose = Field(description="as in the request, meters")


class OtherCurve(Reply):
    """A further DLO of the scene; ``instances``: its id in each view, None where it takes no
    part."""

    curve: Curve3D = Field(description="of one more DLO")
    reprojection_px: float = Field(description="mean distance of the curve to its centerlines")
    instances: list[int | None] = Field(
        description="its id in each view; null where it was not found"
    )


class NextView(Reply):
    """Where to take the next pictures from (thesis section 4.5.4). ``gain``: by how much the mean
    standard deviation is expected to fall, as a share, once these pictures are used; 0.3 is 30 %
    less."""

    baseline_m: float = Field(ge=0, description="from the first to the last of the poses")
    delta_z_m: float = Field(description="added to the distance from the DLO")
    T_world_camera: list[Pose] = Field(
        description="one for each picture, in the order of the slide; meters"
    )
    sigma_m: float = Field(ge=0, description="mean over the points, now")
    expected_sigma_m: float = Field(ge=0, description="mean over the points, with the new pictures")
    gain: float = Field(description="share by which sigma is expected to fall")
    visible: Probability = Field(description="share of the points that all new pictures will show")


class ReconstructResult(Reply):
    kind: Literal["reconstruct"] = Field(default="reconstruct", description="kind of the job")
    method: ReconstructMethod = Field(description="that made the curves")
    curve: Curve3D = Field(description="the target; without one, the longest DLO")
    others: list[OtherCurve] = Field(description="every other DLO, if no target was named")
    views: list[ViewOutcome] = Field(
        description="what became of each picture, in the order of the request"
    )
    reprojection_px: float = Field(description="mean over the views that took part")
    noise_px: float = Field(
        description="standard deviation of the centerlines, as the residuals show it"
    )
    overlap: Probability | None = Field(
        default=None, description="share of the curve that `previous` covers"
    )
    ends: tuple[CurveEnd, CurveEnd] = Field(
        description="of `curve`, at its first and its last point"
    )
    next_view: NextView | None = Field(description="None if no pose within the limits sees the DLO")
    reference: ReferencesUsed = Field(default_factory=list)
    warnings: list[str] = Field(description="what limits the curve")
    models: list[ModelUsed] = Field(description="networks that took part")


class ReconstructRequest(ForegroundOptions, JobRequest[ReconstructResult]):
    """Pictures from known poses to the 3D curves of the DLOs they show.

    ``spline_bundle`` takes any poses; ``dlo3ds`` is the published method, for a camera that slides
    along its x axis.
    """

    kind: Literal["reconstruct"] = Field(default="reconstruct", description="of the job")
    views: list[CameraView] = Field(
        min_length=2, max_length=16, description="pictures and the cameras that took them"
    )
    target: Target | None = Field(
        default=None, description="default: with `previous` its continuation, else all DLOs"
    )
    previous: Curve3D | None = Field(
        default=None, description="the section before, to continue a scan"
    )
    method: ReconstructMethod = Field(
        default="spline_bundle",
        description="`spline_bundle` takes any poses, `dlo3ds` a slide along x",
    )
    threshold: Probability | None = Field(default=None, description="default: the network's own")
    points: int = Field(default=60, ge=4, le=1000, description="how many points a curve has")
    files: list[ReconstructFile] = Field(
        default=["curve", "overlay"], max_length=2, description="to make beside the result"
    )

    @model_validator(mode="after")
    def _usable_views(self) -> ReconstructRequest:
        places = [[row[3] for row in view.T_world_camera[:3]] for view in self.views]
        if (
            max(
                sum((a - b) ** 2 for a, b in zip(place, places[0], strict=True)) for place in places
            )
            < _SAME_PLACE_M**2
        ):
            raise ValueError(
                "`views` were all taken from the same place: depth needs a camera that has moved"
            )
        if self.target is not None and self.target.view >= len(self.views):
            raise ValueError(
                f"`target` names view {self.target.view}, but there are {len(self.views)} views"
            )
        if self.reference and len(self.reference) != len(self.views):
            raise ValueError(
                f"`reference` has {len(self.reference)} pictures for {len(self.views)} views: one a view"
            )
        return self


class NextViewResult(Reply):
    kind: Literal["next_view"] = Field(default="next_view", description="kind of the job")
    next_view: NextView = Field(description="the poses and what they are expected to bring")


class NextViewRequest(JobRequest[NextViewResult]):
    """From where to look at a DLO that is roughly known: the best baseline and distance (thesis eq.
    4.2 to 4.4)."""

    kind: Literal["next_view"] = Field(default="next_view", description="of the job")
    curve: Curve3D = Field(description="the DLO as far as it is known")
    cameras: list[CameraPose] = Field(
        min_length=1,
        max_length=16,
        description="those that `curve` was seen with; the last is where the camera stands",
    )
    pictures: int = Field(default=3, ge=2, le=16, description="how many will be taken")
    optimise: Optimise = Field(default="bz", description="baseline, distance, both, or neither")
    baseline_m: float = Field(
        default=0.05, ge=1e-5, le=10, description="where it is not optimised, first to last pose"
    )
    baseline_at_most_m: float = Field(
        default=1.0, ge=1e-5, le=10, description="longest baseline that the cell allows"
    )
    nearest_m: float = Field(
        default=0.1, ge=1e-3, le=100, description="z_min: the camera comes no nearer to the DLO"
    )
    delta_z_m: tuple[float, float] = Field(
        default=(-0.5, 0.5), description="least and largest change of distance"
    )
    margin_px: float = Field(
        default=20, ge=0, le=10_000, description="sigma: kept free at the picture's border"
    )
    advance: bool = Field(
        default=False, description="move on to the end of the curve, to continue a scan"
    )
    overlap: float = Field(
        default=0.5, ge=0.05, lt=1, description="n_o: share of the view that shows known points"
    )

    @model_validator(mode="after")
    def _range(self) -> NextViewRequest:
        if not -100 <= self.delta_z_m[0] <= 0 <= self.delta_z_m[1] <= 100:
            raise ValueError("`delta_z_m` is a range around 0 of at most 100 m")
        return self


class MergeCurvesResult(Reply):
    kind: Literal["merge_curves"] = Field(default="merge_curves", description="kind of the job")
    curve: Curve3D = Field(description="all sections as one curve")
    disagreement_m: float = Field(
        ge=0, description="mean distance of the sections from the merged curve"
    )
    outliers: int = Field(ge=0, description="points that the filter passed over")


class MergeCurvesRequest(JobRequest[MergeCurvesResult]):
    """Sections of one DLO, in the order of the scan, to one filtered curve (LOWESS, thesis section
    4.5.5)."""

    kind: Literal["merge_curves"] = Field(default="merge_curves", description="of the job")
    curves: list[Curve3D] = Field(
        min_length=1,
        max_length=64,
        description=f"sections of one DLO, in the order of the scan, of at most {_MOST_MERGED} points together",
    )
    window_m: float = Field(
        default=0.03, ge=1e-4, le=10, description="length of DLO that a local line is fitted to"
    )
    spacing_m: float | None = Field(
        default=None,
        ge=1e-4,
        le=1,
        description=f"between the points of the result; default 0.005, or what makes it {MOST_POINTS} points",
    )

    @model_validator(mode="after")
    def _not_too_many(self) -> MergeCurvesRequest:
        count = sum(len(curve.points_m) for curve in self.curves)
        if count > _MOST_MERGED:
            raise ValueError(
                f"`curves` hold {count} points together, at most {_MOST_MERGED} are merged"
            )
        return self
