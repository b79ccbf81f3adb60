"""Picture or mask to foreground: where every kind that looks at pictures begins."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from dlo_client.contracts import DisentangleRequest, InstancesRequest, ModelUsed, TopologyRequest
from dlo_client.contracts.foreground import ForegroundOptions, ReferenceUsed
from numpy.typing import NDArray

from models.depth.evidence import alone, combined
from models.instances.scene import Scene
from models.instances.settling import settle
from models.segmentation.effort import PASSES, look
from models.segmentation.empty_place import weigh
from models.segmentation.segment import ForegroundInput, foreground_mask
from models.weights.inference import Network
from workers.stages.depth import SeenDepth
from workers.stages.encoding import model_used
from workers.stages.networks import NoSuchNetworkError
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.pictures import Picture, read_mask, read_picture
from workers.stages.regions import within

MASK_THRESHOLD = 0.5
_ABOVE_ZERO = 1e-6
_GRAY = 140
"""Level of the cables in the picture to draw on where there is a mask alone."""


@dataclass(frozen=True)
class Source:
    """What there is to look at: ``image`` (H, W, 3), ``mask`` (H, W) probability, or both, of one
    size."""

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
    """``probability`` (H, W) of cable; ``cable`` (H, W) what counts as such at ``threshold``;
    ``picture`` (H, W, 3) to draw on; ``models`` that took part; ``reference`` what pictures of the
    empty place were worth, if there were any; ``scene`` the strands of one that is settled."""

    probability: NDArray[np.float32]
    cable: NDArray[np.bool_]
    threshold: float
    picture: NDArray[np.uint8]
    models: list[ModelUsed]
    reference: ReferenceUsed | None = None
    scene: Scene | None = None

    @property
    def references(self) -> list[ReferenceUsed]:
        """As answers list them."""
        return [self.reference] if self.reference else []


def read_source(
    request: InstancesRequest | TopologyRequest | DisentangleRequest,
    tools: Tools,
    depth: SeenDepth | None = None,
) -> Source:
    """``image`` and ``mask`` of a request. A picture with two values is taken as the mask, unless
    there is another one or the request names a network. Without both, what stands out of the
    ``depth`` is the mask.

    Raises InvalidInput naming the field.
    """
    remarks = depth.remarks if depth else []
    if request.image is None and request.mask is None:
        return Source(None, _by_height(depth), remarks)
    source = Source(None, None, remarks)
    if request.image is not None:
        may_be_mask = request.mask is None and request.model is None
        source = Source.of(read_picture(request.image, "image", tools, may_be_mask=may_be_mask))
        source = replace(source, remarks=[*source.remarks, *remarks])
    if depth is not None and source.image is not None:
        check_size("depth", depth.depth_m.shape, "image", source.size)
    if request.mask is None:
        return source
    mask, of_mask = read_mask(request.mask, "mask", tools)
    if source.image is not None:
        check_size("mask", mask.shape, "image", source.image.shape[:2])
    if depth is not None:
        check_size("depth", depth.depth_m.shape, "mask", mask.shape)
    return Source(source.image, mask, [*source.remarks, *of_mask])


def _by_height(depth: SeenDepth | None) -> NDArray[np.float32]:
    if depth is None:
        raise InvalidInput("image", "an image or a mask is needed, or a depth")
    if depth.odds is None:
        raise InvalidInput(
            "depth", "shows no table, so nothing stands out of it: send an image or a mask, too"
        )
    return alone(depth.odds)


def check_size(field: str, size: tuple[int, ...], other: str, wanted: tuple[int, ...]) -> None:
    """Raises InvalidInput naming ``field`` unless both (height, width) are equal."""
    if size != wanted:
        (height, width), (other_height, other_width) = size, wanted
        message = f"is {width} × {height} while the {other} is {other_width} × {other_height}"
        raise InvalidInput(field, message, "size_mismatch")


def find_foreground(
    source: Source,
    tools: Tools,
    options: ForegroundOptions,
    threshold: float | None = None,
    view: int | None = None,
    depth: SeenDepth | None = None,
) -> Foreground:
    """The mask, or what the network of ``options`` sees in the picture (of the ``view``), weighed
    against the pictures of the empty place and the heights of a ``depth``; nothing outside the
    regions. The network's 8-bit form looks, where there is one, unless it is to look thoroughly.

    Raises InvalidInput naming ``model``, ``reference`` or ``regions``.
    """
    if source.mask is not None:
        applied = MASK_THRESHOLD if threshold is None else threshold
        mask = within(options.regions, source.mask)
        picture = _drawn(source.mask) if source.image is None else source.image
        return Foreground(mask, mask >= max(applied, _ABOVE_ZERO), applied, picture, [])
    assert source.image is not None
    network = _network(options, tools)
    settings = ForegroundInput.from_manifest(network.spec.preprocess)
    probability = look(source.image, network, settings, options.effort)
    probability, used = _against_reference(source.image, probability, options, tools, view)
    if depth is not None and depth.odds is not None:
        probability = combined(probability, depth.odds)
    probability = within(options.regions, probability)
    applied = settings.threshold if threshold is None else threshold
    cable = foreground_mask(probability, settings, threshold)
    return Foreground(probability, cable, applied, source.image, [model_used(network.spec)], used)


def settled(
    found: Foreground, source: Source, options: ForegroundOptions, threshold: float | None = None
) -> Foreground:
    """What is left of a picture's foreground once its strands were looked at, and what was added; a
    mask, and what a ``threshold`` was asked for, stay as they are."""
    if source.mask is not None or source.image is None or threshold is not None:
        return found
    seen = settle(source.image, found.probability, found.cable, found.threshold)
    probability = within(options.regions, seen.probability)
    cable = seen.cable if options.regions is None else seen.cable & (probability > 0)
    whole = cable is seen.cable or np.array_equal(cable, seen.cable)
    return replace(found, probability=probability, cable=cable, scene=seen.scene if whole else None)


def _network(options: ForegroundOptions, tools: Tools) -> Network:
    try:
        return tools.weights.foreground(
            options.model, options.default_model, eight_bit=PASSES[options.effort].eight_bit
        )
    except NoSuchNetworkError as error:
        raise InvalidInput(error.field, str(error), "invalid_model") from error


def _against_reference(
    image: NDArray[np.uint8],
    probability: NDArray[np.float32],
    options: ForegroundOptions,
    tools: Tools,
    view: int | None,
) -> tuple[NDArray[np.float32], ReferenceUsed | None]:
    """The probability that the pictures of the empty place leave, and what they were worth."""
    numbers = range(len(options.reference)) if view is None or not options.reference else [view]
    places = []
    for k in numbers:
        place = read_picture(options.reference[k], f"reference.{k}", tools).rgb
        check_size(f"reference.{k}", place.shape[:2], "image", image.shape[:2])
        places.append(place)
    if not places:
        return probability, None
    weighed = weigh(image, probability, places)
    used = ReferenceUsed(
        used=weighed.reason is None,
        agreement=round(weighed.agreement, 4),
        relied=round(weighed.relied, 4),
        shift_px=round(weighed.shift_px, 2),
        reason=weighed.reason,
    )
    return weighed.probability, used


def _drawn(mask: NDArray[np.float32]) -> NDArray[np.uint8]:
    return np.repeat(np.rint(mask * _GRAY).astype(np.uint8)[:, :, None], 3, axis=2)
