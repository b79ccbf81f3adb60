"""Pictures from known poses: to 3D curves, or to labels by strokes of a tracked pen."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from models.geometry.arrays import ByteArray
from models.geometry.cameras import Camera
from models.library import arguments, loading
from models.library.arguments import ArgumentError
from models.library.perception import instances, segment
from models.reconstruction.curves import Curve
from models.reconstruction.joining import rejoin
from models.reconstruction.reconstruct import NotReconstructable, ReconstructParams, reconstruct_all
from models.reconstruction.seeing import view_of
from models.tracked_labels import tracked
from models.tracked_labels.crops import reader_of
from models.tracked_labels.tracked import TrackedParams, TrackedView

__all__ = ["Curve", "NotReconstructable", "label_tracked", "reconstruct"]
_MOST_VIEWS = 16
_THICKEST_M = 0.2


def reconstruct(
    pictures: Sequence[ArrayLike], cameras: Sequence[Camera], *, points: int = 60
) -> list[Curve]:
    """The 3D curves of all DLOs that at least two views agree on (thesis chapter 4), longest first.

    ``pictures``: 2 to 16 of ``(H, W, 3)`` uint8 RGB; ``cameras``: intrinsics and ``T_world_camera``
    of each (z forward, y down, meters). ``points`` of each curve.

    Raises ArgumentError; NotReconstructable where no two views agree on a curve.
    """
    images = _pictures(pictures, cameras, least=2)
    views = []
    for k, (image, camera) in enumerate(zip(images, cameras, strict=True)):
        seen = segment(image)
        views.append(
            view_of(
                instances(image, seen.mask), seen.probability, image, camera, f"pictures[{k}]"
            ).view
        )
    if sum(bool(view.strands) for view in views) < 2:
        raise NotReconstructable("a DLO was found in fewer than two pictures")
    found = reconstruct_all(
        [joined.view for joined in rejoin(views)], ReconstructParams(points=points)
    )
    if not found:
        raise NotReconstructable(
            "no DLO is seen in two views so that the poses fit: are the poses right?"
        )
    return [one.curve for one in found]


def label_tracked(
    pictures: Sequence[ArrayLike],
    cameras: Sequence[Camera],
    strokes_m: Sequence[ArrayLike],
    thickness_m: Sequence[float],
    *,
    params: TrackedParams | None = None,
) -> list[TrackedView]:
    """Labels of every picture from one stroke of a tracked pen along each DLO (DLO-WSL, thesis
    section 2.5).

    ``pictures``, ``cameras``: as for :func:`reconstruct`, one or more. ``strokes_m``: for each DLO
    ``(k, 3)`` points in the world's frame; ``thickness_m``: its diameter. ``params``: of the
    method.

    Raises ArgumentError; StrokeError for a stroke that is no line.
    """
    images = _pictures(pictures, cameras, least=1)
    strokes = [arguments.points(stroke, f"strokes_m[{k}]", 3) for k, stroke in enumerate(strokes_m)]
    if not strokes or len(strokes) != len(thickness_m):
        raise ArgumentError(
            "thickness_m", f"has {len(thickness_m)} values for {len(strokes)} strokes"
        )
    thick = [
        arguments.number(t, f"thickness_m[{k}]", 1e-5, _THICKEST_M)
        for k, t in enumerate(thickness_m)
    ]
    reader = reader_of(loading.default("corrector"))
    return tracked.label_tracked(
        images, list(cameras), strokes, thick, reader, params or TrackedParams()
    )


def _pictures(
    pictures: Sequence[ArrayLike], cameras: Sequence[Camera], least: int
) -> list[ByteArray]:
    if not least <= len(pictures) <= _MOST_VIEWS:
        raise ArgumentError("pictures", f"are {len(pictures)}; {least} to {_MOST_VIEWS} are taken")
    if len(pictures) != len(cameras):
        raise ArgumentError("cameras", f"are {len(cameras)} for {len(pictures)} pictures")
    images = [arguments.picture(value, f"pictures[{k}]") for k, value in enumerate(pictures)]
    for k, (image, camera) in enumerate(zip(images, cameras, strict=True)):
        if not isinstance(camera, Camera):
            raise ArgumentError(f"cameras[{k}]", f"is a {type(camera).__name__}, no dlo.Camera")
        size = camera.intrinsics.width, camera.intrinsics.height
        if image.shape[1::-1] != size:
            found = f"{image.shape[1]} × {image.shape[0]}"
            raise ArgumentError(
                f"cameras[{k}]",
                f"is of a picture of {size[0]} × {size[1]}, but pictures[{k}] is {found}",
            )
    return images
