"""Blobs as objects in a bucket of an S3 server: for hosts that share no folder.

Needs ``requirements/s3.txt``. Who we are and where the server is comes from the variables of AWS
(``AWS_ACCESS_KEY_ID``, ``AWS_ENDPOINT_URL_S3``, …), or from the role that the machine has.

Strategy: a blob is an object under its id. The age of an object is its lifetime, so touching one
copies it onto itself inside the server; one that this process touched a moment ago is left as it
is, and the lifetime is longer by that moment. Staged bytes are objects beside, copied to their
place when they are kept: several replicas of the service need no disk of their own.
"""

from __future__ import annotations

import hashlib
import math
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

import boto3
from botocore.config import Config
from botocore.exceptions import BotoCoreError, ClientError

from workers.blobs.contract import BlobMissing, BlobsUnreachableError, NoRoomError, Staged

_ID = re.compile(r"[0-9a-f]{64}")
_ABSENT = ("NoSuchKey", "404", "NotFound")
_FULL = ("507", "InsufficientStorage", "XMinioStorageFull", "QuotaExceeded")
_STAGED_FOR_S = 3600.0
_FRESH_S = 60.0
_MOST_FRESH = 10_000
KEPT = "kept/"
"""Below the folder of the blobs: objects that are none and have no lifetime."""
CONFIG = Config(
    connect_timeout=2,
    read_timeout=20,
    retries={"mode": "standard", "total_max_attempts": 3},
    max_pool_connections=64,
)


@dataclass(frozen=True)
class StagedObject:
    """See :class:`workers.blobs.Staged`."""

    blob_id: str
    bytes: int
    _blobs: BucketBlobs
    _beside: str | None

    @property
    def is_new(self) -> bool:
        return self._beside is not None

    def keep(self) -> str:
        if self._beside is None:
            self._blobs.touch(self.blob_id)
        else:
            self._blobs.move(self._beside, self.blob_id)
        return self.blob_id

    def drop(self) -> None:
        if self._beside is not None:
            self._blobs.remove(self._beside)


class BucketBlobs:
    """See :class:`workers.blobs.Blobs`."""

    def __init__(self, client: Any, bucket: str, folder: str, lifetime_s: float) -> None:
        self._client = client
        self._bucket = bucket
        self._folder = folder
        self._lifetime_s = lifetime_s
        self.place = f"the bucket s3://{bucket}/{folder}"
        self._fresh_s = min(_FRESH_S, lifetime_s / 2)
        self._touched: dict[str, float] = {}
        """Blob ids to when this process last touched them, on the monotonic clock."""

    @classmethod
    def at(cls, url: str, lifetime_s: float) -> BucketBlobs:
        """``s3://bucket/folder``."""
        parts = urlsplit(url)
        folder = parts.path.strip("/")
        return cls(
            boto3.client("s3", config=CONFIG), parts.netloc, folder and f"{folder}/", lifetime_s
        )

    def put(self, data: bytes) -> str:
        """See :class:`workers.blobs.Blobs`."""
        blob_id = hashlib.sha256(data).hexdigest()
        if not self.touch(blob_id):
            self._write(self._name(blob_id), data)
        return blob_id

    def stage(self, data: bytes) -> StagedObject:
        """See :class:`workers.blobs.Blobs`."""
        blob_id = hashlib.sha256(data).hexdigest()
        if self.touch(blob_id):
            return StagedObject(blob_id, len(data), self, None)
        beside = f"{self._folder}staged/{uuid4().hex}"
        self._write(beside, data)
        return StagedObject(blob_id, len(data), self, beside)

    def get(self, blob_id: str) -> bytes:
        """See :class:`workers.blobs.Blobs`."""
        return self._read(self._name(blob_id))

    def path(self, blob_id: str) -> Path | None:
        """No file holds them."""
        with told(blob_id):
            self._client.head_object(Bucket=self._bucket, Key=self._name(blob_id))
        return None

    def touch(self, blob_id: str) -> bool:
        """See :class:`workers.blobs.Blobs`."""
        if time.monotonic() - self._touched.get(blob_id, -math.inf) < self._fresh_s:
            return True
        try:
            self._copy(self._name(blob_id), self._name(blob_id), blob_id)
        except BlobMissing:
            return False
        return True

    def move(self, beside: str, blob_id: str) -> None:
        """Make a blob of a staged object, unless that was done before."""
        try:
            self._copy(beside, self._name(blob_id), blob_id)
        except BlobMissing:
            if not self.touch(blob_id):
                raise
        self.remove(beside)

    def remove(self, name: str) -> None:
        """Of an object that is not there nothing is removed."""
        with told(name):
            self._client.delete_object(Bucket=self._bucket, Key=name)

    def let_go(self, staged: Staged, after_s: float) -> None:
        """An object has no age but that of its last write: these live as long as any."""

    def sweep(self, now: float | None = None) -> int:
        """See :class:`workers.blobs.Blobs`."""
        removed = 0
        for name, age_s in self._ages(now):
            last = name.rpartition("/")[2]
            is_blob = _ID.fullmatch(last)
            lifetime_s = (
                self._lifetime_s + self._fresh_s
                if is_blob
                else min(_STAGED_FOR_S, self._lifetime_s)
            )
            if (
                last != "mark"
                and age_s > lifetime_s
                and not name.startswith(f"{self._folder}{KEPT}")
            ):
                self.remove(name)
                removed += 1
        return removed

    def mark(self, *, make: bool = False) -> str | None:
        """See :class:`workers.blobs.Blobs`."""
        name = f"{self._folder}mark"
        try:
            return self._read(name).decode()
        except BlobMissing:
            if not make:
                return None
        with told(name, but="PreconditionFailed"):  # another process was first
            self._client.put_object(
                Bucket=self._bucket, Key=name, Body=uuid4().hex.encode(), IfNoneMatch="*"
            )
        return self._read(name).decode()

    def _read(self, name: str) -> bytes:
        with told(name):
            body: bytes = self._client.get_object(Bucket=self._bucket, Key=name)["Body"].read()
        return body

    def _ages(self, now: float | None) -> Iterator[tuple[str, float]]:
        """Names, and seconds since they were last written, by the server's clock unless ``now`` is
        given."""
        pages = self._client.get_paginator("list_objects_v2").paginate(
            Bucket=self._bucket, Prefix=self._folder
        )
        with told(self._folder):
            for page in pages:
                date = page["ResponseMetadata"]["HTTPHeaders"]["date"]
                at = parsedate_to_datetime(date).timestamp() if now is None else now
                for found in page.get("Contents", ()):
                    yield found["Key"], at - found["LastModified"].timestamp()

    def _name(self, blob_id: str) -> str:
        if not _ID.fullmatch(blob_id):
            raise BlobMissing(blob_id)
        return f"{self._folder}{blob_id[:2]}/{blob_id}"

    def _write(self, name: str, data: bytes) -> None:
        with told(name):
            self._client.put_object(Bucket=self._bucket, Key=name, Body=data)

    def _copy(self, source: str, target: str, blob_id: str) -> None:
        """With new metadata, as a server refuses to copy an object onto itself without."""
        now = time.monotonic()
        with told(blob_id):
            self._client.copy_object(
                Bucket=self._bucket,
                CopySource={"Bucket": self._bucket, "Key": source},
                Key=target,
                MetadataDirective="REPLACE",
                Metadata={"touched": f"{time.time():.3f}"},
            )
        if len(self._touched) >= _MOST_FRESH:
            self._touched.clear()
        self._touched[blob_id] = now


@contextmanager
def told(blob_id: str, but: str = "") -> Iterator[None]:
    """Errors of the server as those of blobs; one whose code is ``but`` is none."""
    try:
        yield
    except ClientError as error:
        code = error.response.get("Error", {}).get("Code", "")
        if code == but:
            return
        if code in _ABSENT:
            raise BlobMissing(blob_id) from None
        if code in _FULL:
            raise NoRoomError(str(error)) from error
        raise BlobsUnreachableError(str(error)) from error
    except BotoCoreError as error:
        raise BlobsUnreachableError(str(error)) from error
