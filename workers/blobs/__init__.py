"""Bytes in and out by their SHA-256, with a lifetime: in a folder, or in a bucket where hosts share
none."""

from __future__ import annotations

from workers.blobs.contract import BlobMissing, Blobs, BlobsUnreachableError, NoRoomError, Staged
from workers.blobs.folder import FolderBlobs
from workers.settings import Settings

__all__ = [
    "BlobMissing",
    "Blobs",
    "BlobsUnreachableError",
    "FolderBlobs",
    "NoRoomError",
    "Staged",
    "open_blobs",
]


def open_blobs(settings: Settings, reserve_bytes: int | None = None) -> Blobs:
    """Where the settings say; ``reserve_bytes`` of a disk stay free (by default those of the
    settings).

    Raises:
        ModuleNotFoundError: a bucket is asked for, and what it needs is not installed.
    """
    if settings.blobs_url:
        try:
            from workers.blobs.bucket import BucketBlobs
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(
                f"DLO_BLOBS_URL is set: install requirements/s3.txt ({error})"
            ) from error
        return BucketBlobs.at(settings.blobs_url, settings.blob_ttl_s)
    reserve = settings.disk_reserve_bytes if reserve_bytes is None else reserve_bytes
    return FolderBlobs(settings.blobs_dir, settings.blob_ttl_s, reserve)
