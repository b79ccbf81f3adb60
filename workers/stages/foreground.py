"""Picture or mask to foreground: where every kind that looks at pictures begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import DisentangleRequest, InstancesRequest, ModelUsed, TopologyRequest
from numpy.typing import NDArray

from models.segmentation.effort import Effort, look
from models.segmentation.segment import ForegroundInput, foreground_mask
from models.weights.inference import default_name, manifest
from workers.stages.encoding import model_used
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.pictures import Picture, read_mask, read_picture

TASK = "foreground"
_EIGHT_BIT = "_int8"
"""Ends the name of a network's 8-bit form."""
MASK_THRESHOLD = 0.5
_ABOVE_ZERO = 1e-6
_GRAY = 140
"""Level of the cables in the picture to draw on where there is a mask alone."""


@dataclass(frozen=True)
class Source:
    """What there is to look at: ``image`` (H, W, 3), ``mask`` (H, W) probability, or both, of one size."""

    image: NDArray[np.uint8] | None
    mask: NDArray[np.float32] | None
    remarks: list[str]

    @property
    def size(self) -> tuple[int, ...]:
        """(height, width)"""
        shape: tuple[int, ...] = np.shape(self.mask if self.image is None else self.image)  # type: ignore[arg-type]
        return shape[:2]

    @classmethod
    def of(cls, picture: Picture) -> Source:
        """A picture alone; one that was recognised as a mask is nothing but a mask."""
        return cls(picture.rgb if picture.mask is None else None, picture.mask, picture.remarks)


@dataclass(frozen=True)
class Foreground:
    """``probability`` (H, W) of cable; ``cable`` (H, W) what counts as such at ``threshold``; ``picture`` (H, W, 3) to
    draw on; ``models`` that took part."""

    probability: NDArray[np.float32]
    cable: NDArray[np.bool_]
    threshold: float
    picture: NDArray[np.uint8]
    models: list[ModelUsed]


def read_source(request: InstancesRequest | TopologyRequest | DisentangleRequest, tools: Tools) -> Source:
    """``image`` and ``mask`` of a request. A picture with two values is taken as the mask, unless there is another one
    or the request names a network.

    Raises InvalidInput naming the field.
    """
    if request.image is None and request.mask is None:
        raise InvalidInput("image", "an image or a mask is needed")
    source = Source(None, None, [])
    if request.image is not None:
        may_be_mask = request.mask is None and request.model is None
        source = Source.of(read_picture(request.image, "image", tools, may_be_mask=may_be_mask))
    if request.mask is None:
        return source
    mask, remarks = read_mask(request.mask, "mask", tools)
    if source.image is not None:
        check_size("mask", mask.shape, "image", source.image.shape[:2])
    return Source(source.image, mask, [*source.remarks, *remarks])


def check_size(field: str, size: tuple[int, ...], other: str, wanted: tuple[int, ...]) -> None:
    """Raises InvalidInput naming ``field`` unless both (height, width) are equal."""
    if size != wanted:
        (height, width), (other_height, other_width) = size, wanted
        message = f"is {width} × {height} while the {other} is {other_width} × {other_height}"
        raise InvalidInput(field, message, "size_mismatch")


def find_foreground(
    source: Source,
    tools: Tools,
    *,
    model: str | None = None,
    threshold: float | None = None,
    effort: Effort = "normal",
) -> Foreground:
    """The mask, or what the network named ``model`` (the default one where it is None) sees in the picture. In a hurry
    its 8-bit form looks, where there is one.

    Raises InvalidInput naming ``model``.
    """
    if source.mask is not None:
        applied = MASK_THRESHOLD if threshold is None else threshold
        cable = source.mask >= max(applied, _ABOVE_ZERO)
        picture = _drawn(source.mask) if source.image is None else source.image
        return Foreground(source.mask, cable, applied, picture, [])
    assert source.image is not None
    name = model or default_name(TASK)
    spec = manifest().get(name)
    if spec is None or spec.task != TASK:
        known = ", ".join(s.name for s in manifest().values() if s.task == TASK)
        raise InvalidInput("model", f"there is no foreground network {name!r}; there are: {known}", "invalid_model")
    if effort == "fast":
        spec = manifest().get(f"{name}{_EIGHT_BIT}", spec)
    settings = ForegroundInput.from_manifest(spec.preprocess)
    probability = look(source.image, tools.network(spec.name), settings, effort)
    applied = settings.threshold if threshold is None else threshold
    cable = foreground_mask(probability, settings, threshold)
    return Foreground(probability, cable, applied, source.image, [model_used(spec)])


def _drawn(mask: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.repeat(np.rint(mask * _GRAY).astype(np.uint8)[:, :, None], 3, axis=2)
