"""Pictures on their way in: looked at, staged, and kept as blobs once what they came with is
accepted."""

from __future__ import annotations

import time

from anyio import to_thread
from dlo_client.contracts import ImageInfo

from services.examples import PICTURES, UPLOADS
from services.problems import field_error
from services.settings import ServiceSettings
from workers.blobs import BlobMissing, Blobs, Staged
from workers.pictures.clouds import is_cloud, size_of
from workers.pictures.headers import PictureError, Size, inspect

_MOST_KNOWN = 10_000
_FRESH_S = 5.0
_FRESH_SHARE = 0.01
"""For so long, or this share of a picture's lifetime, one that was seen to be there is not looked
for again: who asks about the same picture again and again pays for a trip to the disk, or to S3,
once."""


class Uploads:
    """Stages pictures and knows their sizes. The work is done in threads: it hashes and touches the
    disk."""

    def __init__(self, settings: ServiceSettings, blobs: Blobs) -> None:
        self._max_pixels = settings.max_image_pixels
        self._blobs = blobs
        self._looked_at: dict[str, tuple[ImageInfo, float]] = {}
        """What is known of pictures, whose bytes never change, so that they are read once, not with
        every request; and until when, s of the monotonic clock, they are surely there."""
        self._fresh_s = min(_FRESH_S, _FRESH_SHARE * settings.blob_ttl_s)

    async def stage(
        self, data: bytes, *, field: str, cloud: bool = False
    ) -> tuple[ImageInfo, Staged]:
        """Look at the picture that came in as ``field`` and write it down, to be kept or dropped;
        ``cloud``: it may be a point cloud, as a ``depth`` may.

        Raises:
            ProblemError: 422 when it is no whole picture or has too many pixels.
            NoRoomError: the disk is too full.
        """
        return await to_thread.run_sync(self._stage, data, field, cloud)

    async def find(self, image_id: str, *, field: str) -> ImageInfo:
        """The picture kept before that ``field`` refers to; its lifetime begins anew, unless it
        just did.

        Raises:
            ProblemError: 422 ``unknown_image`` when it is not, or no longer, kept.
        """
        known, sure_until = self._looked_at.get(image_id, (None, 0.0))
        if known and time.monotonic() < sure_until:
            return known
        return await to_thread.run_sync(self._find, image_id, field)

    def keep(self, upload_id: str) -> bool:
        """Start the lifetime of an upload, or one of the examples, anew; False if there is none."""
        if self._blobs.touch(upload_id):
            return True
        sample = PICTURES.get(upload_id) or UPLOADS.get(upload_id)
        if sample:
            self._blobs.put(sample)
        return sample is not None

    def _stage(self, data: bytes, field: str, cloud: bool) -> tuple[ImageInfo, Staged]:
        size = self._inspect(data, field, cloud)
        staged = self._blobs.stage(data)
        return self._remember(_info(staged.blob_id, size, len(data)), data), staged

    def _find(self, image_id: str, field: str) -> ImageInfo:
        is_there = self._blobs.touch(image_id)
        known, _ = self._looked_at.get(image_id, (None, 0.0))
        if is_there and known:
            self._looked_at[image_id] = known, time.monotonic() + self._fresh_s
            return known
        try:
            data = self._blobs.get(image_id)
        except BlobMissing:
            if sample := PICTURES.get(image_id):
                self._blobs.put(sample)
                return _info(image_id, self._inspect(sample, field), len(sample))
            message = "no uploaded picture has this id (any longer); upload it first"
            raise field_error(field, message, code="unknown_image") from None
        return self._remember(_info(image_id, self._inspect(data, field), len(data)), data)

    def _remember(self, info: ImageInfo, data: bytes) -> ImageInfo:
        """A point cloud is looked at again: as a picture it is refused."""
        if is_cloud(data):
            return info
        while len(self._looked_at) >= _MOST_KNOWN:
            self._looked_at.pop(next(iter(self._looked_at)), None)
        self._looked_at[info.id] = info, 0.0
        return info

    def _inspect(self, data: bytes, field: str, cloud: bool = False) -> Size:
        try:
            if (cloud or field == "depth") and is_cloud(data):
                return size_of(data, self._max_pixels)
            return inspect(data, max_pixels=self._max_pixels)
        except PictureError as error:
            raise field_error(field, str(error), code="invalid_image") from error


def _info(image_id: str, size: Size, size_bytes: int) -> ImageInfo:
    return ImageInfo(
        id=image_id, sha256=image_id, width=size.width, height=size.height, bytes=size_bytes
    )
