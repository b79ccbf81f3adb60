"""Along a long cable with a camera on a robot arm (thesis sections 4.5.4 and 4.5.5).

Strategy: a few pictures around where the camera stands give a first section. From it the service
says where to take the next pictures, first of the same section from a better baseline and distance,
then ahead of its end, with some overlap, until the cable does not go on; then from the first
section the other way. Last, the sections are merged.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import dist
from typing import Any, Protocol

from pydantic import TypeAdapter

from dlo_client.calls import blocking
from dlo_client.contracts import (
    CameraPose,
    CameraView,
    Curve3D,
    JobRequest,
    MergeCurvesRequest,
    MergeCurvesResult,
    NextViewRequest,
    Pose,
    ReconstructRequest,
    ReconstructResult,
    Spline3,
    Target,
)
from dlo_client.contracts.base import ResultT
from dlo_client.contracts.cameras import AnyIntrinsics
from dlo_client.contracts.reconstruction import Optimise
from dlo_client.errors import InvalidArgument, JobFailed
from dlo_client.pictures import Picture, Pictures

_INTRINSICS: TypeAdapter[AnyIntrinsics] = TypeAdapter(AnyIntrinsics)
_POSE: TypeAdapter[Pose] = TypeAdapter(Pose)
_LEAST_VIEWS, _MOST_VIEWS = 2, 16


class CameraOnArm(Protocol):
    """What a scan needs of a robot. Poses are ``T_world_camera``, 4 × 4, meters; the pose that is
    reported after a move is the one that counts, so an arm that stops a little beside its goal does
    no harm."""

    @property
    def intrinsics(self) -> Mapping[str, Any]:
        """Fields of PinholeIntrinsics or of a ROS CameraInfo."""
        ...

    def pose(self) -> Sequence[Sequence[float]]:
        """Where the camera is now."""
        ...

    def move_to(self, T_world_camera: Sequence[Sequence[float]]) -> None:
        """Bring the camera there and hold it still; an exception ends the scan."""
        ...

    def picture(self) -> Picture:
        """What is seen from here: an encoded picture, or an array of its pixels (H, W, 3)."""
        ...


class Reconstructor(Protocol):
    """The part of Client that a scan uses."""

    def run(self, request: JobRequest[ResultT], image: Pictures | None = None, /) -> ResultT: ...


@dataclass(frozen=True)
class ScanOptions:
    """``views`` pictures a section; ``baseline_m`` of the first ones, and of all where it is not
    optimised.

    ``optimise``: which of baseline and distance the service may choose. ``nearest_m``: the camera
    comes no nearer. ``overlap``: share of the picture that shows the section before. ``at_most``
    sections in each direction; ``least_gain_m``: a section that adds less is the last.
    """

    views: int = 3
    baseline_m: float = 0.05
    optimise: Optimise = "bz"
    overlap: float = 0.5
    nearest_m: float = 0.12
    baseline_at_most_m: float = 0.15
    delta_z_m: tuple[float, float] = (-0.3, 0.3)
    at_most: int = 20
    least_gain_m: float = 0.01
    reconstruct: Mapping[str, Any] = field(default_factory=dict)
    """Further fields of the ReconstructRequests, such as ``threshold``."""

    def __post_init__(self) -> None:
        if not _LEAST_VIEWS <= self.views <= _MOST_VIEWS:
            raise InvalidArgument(
                "views", f"{_LEAST_VIEWS} to {_MOST_VIEWS} pictures a section, not {self.views}"
            )


@dataclass(frozen=True)
class Section:
    """One stop of the scan: the result, the poses of its pictures, and the pictures."""

    result: ReconstructResult
    poses: list[Pose]
    pictures: list[Picture]


@dataclass(frozen=True)
class ScanResult:
    """``sections`` in order along the cable; ``merged``: all of them as one curve; ``ended``: why,
    ahead and behind."""

    merged: MergeCurvesResult
    sections: list[Section]
    ended: list[str]

    @property
    def curve(self) -> Curve3D:
        return self.merged.curve


class Scan:
    """A scan of the cable nearest to ``target`` (x, y) of the first picture, by default to its
    center.

    Raises what the client raises, and what the arm raises.
    """

    def __init__(
        self,
        client: Reconstructor,
        arm: CameraOnArm,
        options: ScanOptions | None = None,
        target_xy: tuple[float, float] | None = None,
    ) -> None:
        blocking(client, type(self).__name__)
        self._client = client
        self._arm = arm
        self._options = options or ScanOptions()
        self._intrinsics = _INTRINSICS.validate_python(dict(arm.intrinsics))
        self._target_xy = target_xy
        self._ended: list[str] = []

    def run(self) -> ScanResult:
        """The whole cable, from the middle to one end, then to the other."""
        first = self._first()
        ahead = [first, *self.onwards(first)]
        turned = _with_curve(first, reversed_curve(first.result.curve))
        behind = list(self.onwards(turned))
        sections = [*reversed(behind), *ahead]
        merged = self._client.run(MergeCurvesRequest(curves=[s.result.curve for s in sections]))
        return ScanResult(merged, sections, self._ended)

    def onwards(self, section: Section) -> Iterator[Section]:
        """Sections ahead of the end of ``section``, until the cable does not go on."""
        for _ in range(self._options.at_most):
            try:
                following = self._take(
                    self._planned(section, advance=True), previous=section.result.curve
                )
            except JobFailed as error:
                self._ended.append(error.problem.detail)
                return
            yield following
            if following.result.ends[1] == "free":
                self._ended.append("the cable ends in view, or is hidden from there on")
                return
            if _added_m(following.result.curve, section.result.curve) < self._options.least_gain_m:
                self._ended.append("the pictures do not show how the cable goes on")
                return
            section = following
        self._ended.append(f"after {self._options.at_most} sections")

    def _first(self) -> Section:
        """Around where the camera stands; then once more from better poses, unless these are
        fixed."""
        start = _POSE.validate_python(self._arm.pose())
        options = self._options
        slide = [options.baseline_m * (k / (options.views - 1) - 0.5) for k in range(options.views)]
        section = self._take([_slid(start, x) for x in slide], previous=None)
        if options.optimise == "fixed":
            return section
        return self._take(self._planned(section, advance=False), previous=section.result.curve)

    def _planned(self, section: Section, *, advance: bool) -> list[Pose]:
        options = self._options
        request = NextViewRequest(
            curve=section.result.curve,
            cameras=[
                CameraPose(intrinsics=self._intrinsics, T_world_camera=pose)
                for pose in section.poses
            ],
            pictures=options.views,
            optimise=options.optimise,
            baseline_m=options.baseline_m,
            baseline_at_most_m=options.baseline_at_most_m,
            nearest_m=options.nearest_m,
            delta_z_m=options.delta_z_m,
            advance=advance,
            overlap=options.overlap,
        )
        return self._client.run(request).next_view.T_world_camera

    def _take(self, poses: Sequence[Pose], previous: Curve3D | None) -> Section:
        """Pictures from the poses, and what they show."""
        reached, pictures = [], []
        for pose in poses:
            self._arm.move_to(pose)
            reached.append(_POSE.validate_python(self._arm.pose()))
            pictures.append(self._arm.picture())
        target = None
        if previous is None:
            middle = len(poses) // 2
            width, height = self._intrinsics.picture_size
            center = ((width - 1) / 2, (height - 1) / 2)
            target = Target(view=middle, xy=self._target_xy or center)
        request = ReconstructRequest(
            views=[
                CameraView(intrinsics=self._intrinsics, T_world_camera=pose) for pose in reached
            ],
            target=target,
            previous=previous,
            **self._options.reconstruct,
        )
        return Section(self._client.run(request, pictures), reached, pictures)


def reversed_curve(curve: Curve3D) -> Curve3D:
    """The same curve, from its end to its beginning."""
    spline = Spline3(
        degree=curve.spline.degree,
        knots=[1 - k for k in reversed(curve.spline.knots)],
        control_m=curve.spline.control_m[::-1],
    )
    turned = {name: getattr(curve, name)[::-1] for name in ("points_m", "covariance_m2", "sigma_m")}
    return curve.model_copy(update=turned | {"spline": spline})


def _with_curve(section: Section, curve: Curve3D) -> Section:
    return Section(
        section.result.model_copy(update={"curve": curve}), section.poses, section.pictures
    )


def _slid(pose: Pose, along_x: float) -> Pose:
    """The pose moved along the camera's own x axis."""
    rows = [(*row[:3], row[3] + along_x * row[0]) for row in pose[:3]]
    return rows[0], rows[1], rows[2], pose[3]


def _added_m(curve: Curve3D, previous: Curve3D) -> float:
    """How far the end of ``curve`` is from all of ``previous``."""
    end = curve.points_m[-1]
    return min(dist(end, point) for point in previous.points_m)
