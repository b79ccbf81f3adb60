"""The pictures of a ``reconstruct`` request: what is found in each, and which of it is asked
for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from dlo_client.contracts import ModelUsed, ReconstructRequest, Target
from dlo_client.contracts.foreground import ReferenceUsed
from numpy.typing import NDArray

from models.geometry.cameras import Camera
from models.geometry.sampling import at_scale
from models.reconstruction.curves import Curve
from models.reconstruction.joining import rejoin
from models.reconstruction.seeing import view_of
from models.reconstruction.tracking import continuing_strand
from models.reconstruction.views import View
from workers.stages.foreground import Source
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.perception import perceive
from workers.stages.posed_pictures import read_view

NO_CURVE = "invalid_views"
_NEAR_TARGET_PX = 40.0


@dataclass(frozen=True)
class SeenView:
    """A picture, its camera, and the working view with its ``scale`` (working pixels a pixel).

    ``ids`` (i,) of the instances found in the picture alone; ``share_px`` (strands, i) how much of
    each instance is in each strand of ``view``: the strands are joined anew from all views.
    """

    image: NDArray[np.uint8]
    camera: Camera
    view: View
    scale: float
    ids: list[int]
    share_px: NDArray[np.float64]
    reference: ReferenceUsed | None = None

    def instance(self, strands: tuple[int, ...]) -> int | None:
        """Id of the instance that makes up the most of the strands."""
        return (
            self.ids[int(np.argmax(self.share_px[list(strands)].sum(axis=0)))] if strands else None
        )

    def strand_of(self, instance: int) -> int:
        """The strand that holds the most of an instance."""
        return int(np.argmax(self.share_px[:, self.ids.index(instance)]))


def see(
    request: ReconstructRequest, tools: Tools
) -> tuple[list[SeenView], list[ModelUsed], list[str]]:
    """Raises InvalidInput for a picture that comes twice, is missing, unreadable, or not of its
    camera's size."""
    seen: list[SeenView] = []
    models: list[ModelUsed] = []
    remarks: list[str] = []
    for index, given in enumerate(request.views):
        picture, camera = read_view(
            given, f"views.{index}", tools, may_be_mask=request.model is None
        )
        remarks += picture.remarks
        found = perceive(
            Source.of(picture), tools, request, threshold=request.threshold, view=index
        )
        name = given.name or f"views.{index}"
        one = view_of(found.scene, found.foreground.probability, picture.rgb, camera, name)
        shares = np.zeros((len(one.ids), len(one.ids)))
        reference = found.foreground.reference
        seen.append(SeenView(picture.rgb, camera, one.view, one.scale, one.ids, shares, reference))
        models.extend(m for m in found.models if m not in models)
        tools.progress(0.9 * (index + 1) / len(request.views))
    _check_pictures(request, seen)
    joined = rejoin([s.view for s in seen])
    return (
        [replace(s, view=r.view, share_px=r.share_px) for s, r in zip(seen, joined, strict=True)],
        models,
        remarks,
    )


def _check_pictures(request: ReconstructRequest, seen: list[SeenView]) -> None:
    """Raises InvalidInput for one picture of a DLO at two poses: it would put it at infinity."""
    first: dict[str, int] = {}
    for number, view in enumerate(request.views):
        before = first.setdefault(str(view.image), number)
        if (
            seen[number].view.strands
            and view.T_world_camera != request.views[before].T_world_camera
        ):
            message = f"is the picture of views.{before} again, but from another pose"
            raise InvalidInput(f"views.{number}.image", message, NO_CURVE)


def chosen_strand(
    request: ReconstructRequest, seen: list[SeenView], previous: Curve | None
) -> tuple[int, int] | None:
    """(view, strand) that the request asks for, or None if it asks for all."""
    if request.target is not None:
        return request.target.view, _target(request.target, seen[request.target.view])
    if previous is None:
        return None
    following = continuing_strand(previous, [s.view for s in seen])
    if following is None:
        raise InvalidInput(
            "previous",
            "is seen in none of the views: the next pictures have to overlap it",
            NO_CURVE,
        )
    return following


def _target(target: Target, seen: SeenView) -> int:
    if target.instance is not None:
        if target.instance not in seen.ids:
            known = ", ".join(map(str, seen.ids)) or "none"
            message = (
                f"there is no instance {target.instance} in views.{target.view}; there are: {known}"
            )
            raise InvalidInput("target.instance", message, NO_CURVE)
        return seen.strand_of(target.instance)
    samples = seen.view.samples
    if not len(samples.xy):
        raise InvalidInput("target.view", f"no DLO was found in views.{target.view}", NO_CURVE)
    pixel = seen.camera.undistort(np.array([target.xy], np.float64))
    if not np.isfinite(pixel).all():
        raise InvalidInput("target.xy", "lies outside of what the lens shows", NO_CURVE)
    distance, nearest = samples.tree.query(at_scale(pixel, seen.scale)[0])
    if distance > _NEAR_TARGET_PX:
        raise InvalidInput(
            "target.xy", f"the nearest DLO is {distance / seen.scale:.0f} pixels away", NO_CURVE
        )
    return int(samples.strand[nearest])
