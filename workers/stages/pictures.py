"""The pictures that a request names, through the gate of :mod:`workers.pictures`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dlo_client.contracts import ImageSource
from dlo_client.contracts.images import ImageRef
from numpy.typing import NDArray

from workers.blobs import BlobMissing
from workers.pictures import clouds
from workers.pictures.decoding import Samples, decode
from workers.pictures.headers import PictureError
from workers.pictures.masks import foreground_of
from workers.pictures.photographs import rgb_of
from workers.pictures.two_valued import why_a_mask
from workers.stages.outcome import InvalidInput, Tools

_FARTHEST_M = 100.0
"""Of what depth cameras see."""


@dataclass(frozen=True)
class Picture:
    """``rgb`` (H, W, 3); ``mask`` (H, W) probability of cable where the picture was recognised as a
    mask; ``remarks`` for the one who sent it, each with the field's name."""

    rgb: NDArray[np.uint8]
    mask: NDArray[np.float32] | None
    remarks: list[str]


def read_picture(
    source: ImageSource, field: str, tools: Tools, *, may_be_mask: bool = False
) -> Picture:
    """The upright picture. Raises InvalidInput naming ``field``."""
    samples = _samples(source, field, tools)
    if may_be_mask and (why := why_a_mask(samples)):
        mask, remarks = _mask(samples, field)
        taken = f"{field}: {why}, so it was taken as a mask; name a `model` to have it looked at as a photograph"
        return Picture(rgb_of(samples)[0], mask, [taken, *remarks])
    rgb, remarks = rgb_of(samples)
    return Picture(rgb, None, _named(field, remarks))


def read_mask(
    source: ImageSource, field: str, tools: Tools
) -> tuple[NDArray[np.float32], list[str]]:
    """Foreground probability (H, W), and remarks. Raises InvalidInput naming ``field``."""
    return _mask(_samples(source, field, tools), field)


def read_depth_m(source: ImageSource, field: str, tools: Tools) -> NDArray[np.float32]:
    """Distance to the camera (H, W) in meters from 16-bit gray in millimeters or floats in meters;
    NaN is unknown.

    Raises InvalidInput naming ``field``, also for a picture of 8 bits or of colors.
    """
    values = _samples(source, field, tools, holes=True).values
    if values.ndim != 2 or values.dtype not in (np.uint16, np.int32, np.float32):
        message = "should be 16-bit gray, in millimeters, or gray of floats, in meters"
        raise InvalidInput(field, message, "invalid_depth")
    meters = values.astype(np.float32) / (1 if values.dtype == np.float32 else 1000)
    if meters.max() > _FARTHEST_M:
        message = f"has distances up to {meters.max():g} m: floats are meters, not millimeters"
        raise InvalidInput(field, message, "invalid_depth")
    return np.asarray(np.where(meters > 0, meters, np.nan), np.float32)


def read_cloud_m(source: ImageSource, field: str, tools: Tools) -> NDArray[np.float32] | None:
    """Points (H, W, 3) in meters of an organised point cloud, NaN unknown; None if it is a picture.

    Raises InvalidInput naming ``field``.
    """
    data = _bytes(source, field, tools)
    if not clouds.is_cloud(data):
        return None
    try:
        points = clouds.points_of(data, tools.max_image_pixels)
    except PictureError as error:
        raise InvalidInput(field, str(error), "invalid_depth") from error
    known = np.isfinite(points).all(2) & (points[..., 2] > 0)
    if not known.any():
        raise InvalidInput(
            field, "is a point cloud without a point before the camera (z forward)", "invalid_depth"
        )
    farthest = float(points[known, 2].max())
    if farthest > _FARTHEST_M:
        raise InvalidInput(
            field, f"has points up to {farthest:g} m away: points are in meters", "invalid_depth"
        )
    return np.asarray(np.where(known[..., None], points, np.nan), np.float32)


def _mask(samples: Samples, field: str) -> tuple[NDArray[np.float32], list[str]]:
    try:
        mask, remarks = foreground_of(samples)
    except PictureError as error:
        raise InvalidInput(field, str(error), "invalid_mask") from error
    return mask, _named(field, remarks)


def _named(field: str, remarks: list[str]) -> list[str]:
    return [f"{field}: {remark}" for remark in remarks]


def _samples(source: ImageSource, field: str, tools: Tools, *, holes: bool = False) -> Samples:
    data = _bytes(source, field, tools)
    try:
        return decode(data, max_pixels=tools.max_image_pixels, holes=holes)
    except PictureError as error:
        raise InvalidInput(field, str(error)) from error


def _bytes(source: ImageSource, field: str, tools: Tools) -> bytes:
    if not isinstance(source, ImageRef):
        raise TypeError("the service resolves parts to ids before it enqueues")
    try:
        return tools.blobs.get(source.id)
    except BlobMissing as error:
        raise InvalidInput(
            field, "its bytes have expired: upload it again", "unknown_image"
        ) from error
