"""Files without a lifetime in the bucket that holds the blobs: what hosts that share no folder keep
of networks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

import boto3
from botocore.exceptions import ClientError

from workers.blobs.bucket import CONFIG, KEPT, told
from workers.blobs.contract import BlobMissing, BlobsUnreachableError

_STALE_S = 60.0
"""A lock that is older was left by a process that was killed."""
_PATIENCE_S, _PAUSE_S = 90.0, 0.2
_TAKEN = ("PreconditionFailed", "ConditionalRequestConflict")


class BucketFiles:
    """:class:`workers.networks.files.Files` as objects below ``url``, which is
    ``s3://bucket/folder``."""

    def __init__(self, url: str, sort: str) -> None:
        parts = urlsplit(url)
        folder = parts.path.strip("/")
        self._client: Any = boto3.client("s3", config=CONFIG)
        self._bucket = parts.netloc
        self._root = f"{folder and folder + '/'}{KEPT}{sort}/"

    def folders(self) -> list[str]:
        return sorted({name.partition("/")[0] for name in self._keys("") if "/" in name})

    def names(self, folder: str) -> list[str]:
        return sorted(name for name in self._keys(f"{folder}/") if "/" not in name)

    def read(self, folder: str, name: str) -> bytes:
        try:
            with told(name):
                found = self._client.get_object(Bucket=self._bucket, Key=self._key(folder, name))
                data: bytes = found["Body"].read()
        except BlobMissing:
            raise FileNotFoundError(name) from None
        return data

    def write(self, folder: str, name: str, data: bytes) -> None:
        with told(name):
            self._client.put_object(Bucket=self._bucket, Key=self._key(folder, name), Body=data)

    def remove(self, folder: str, name: str | None = None) -> None:
        for one in self.names(folder) if name is None else [name]:
            with told(one):
                self._client.delete_object(Bucket=self._bucket, Key=self._key(folder, one))

    @contextmanager
    def locked(self, folder: str) -> Iterator[None]:
        """The lock is an object that only one can make. Raises BlobsUnreachableError when others
        hold it too long."""
        key, give_up = f"{self._root}{folder}.lock", time.monotonic() + _PATIENCE_S
        while not self._made(key):
            if time.monotonic() > give_up:
                raise BlobsUnreachableError(f"{key} is held by another process")
            time.sleep(_PAUSE_S)
        try:
            yield
        finally:
            with told(key):
                self._client.delete_object(Bucket=self._bucket, Key=key)

    def _made(self, key: str) -> bool:
        try:
            self._client.put_object(
                Bucket=self._bucket, Key=key, Body=uuid4().bytes, IfNoneMatch="*"
            )
        except ClientError as error:
            if error.response.get("Error", {}).get("Code") not in _TAKEN:
                raise BlobsUnreachableError(str(error)) from error
            self._drop_stale(key)
            return False
        return True

    def _drop_stale(self, key: str) -> None:
        try:
            with told(key):
                found = self._client.head_object(Bucket=self._bucket, Key=key)
                age_s = time.time() - found["LastModified"].timestamp()
                if age_s > _STALE_S:
                    self._client.delete_object(Bucket=self._bucket, Key=key)
        except BlobMissing:
            return  # it has just been given back

    def _keys(self, below: str) -> list[str]:
        """Of the objects below a prefix, from it on."""
        pages = self._client.get_paginator("list_objects_v2")
        start = f"{self._root}{below}"
        with told(start):
            found = pages.paginate(Bucket=self._bucket, Prefix=start)
            return [
                one["Key"].removeprefix(start) for page in found for one in page.get("Contents", ())
            ]

    def _key(self, folder: str, name: str) -> str:
        return f"{self._root}{folder}/{name}"
