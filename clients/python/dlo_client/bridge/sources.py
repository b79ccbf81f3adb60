"""Where the picture of a trigger comes from: a file, the newest of a folder, or a camera's snapshot
address."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import httpx

from dlo_client.bridge.cell import NoPictureError, TakePicture
from dlo_client.bridge.settings import PictureSection

_FETCH_S = 10.0


def picture_source(settings: PictureSection) -> TakePicture:
    """A function that takes a picture, or raises NoPictureError."""
    if settings.url is not None:
        address = settings.url
        http = httpx.AsyncClient(timeout=_FETCH_S)

        async def fetch() -> bytes:
            try:
                reply = await http.get(address)
            except httpx.HTTPError as error:
                raise NoPictureError(str(error)) from error
            if not reply.is_success or not reply.content:
                raise NoPictureError(f"{address} answers {reply.status_code}")
            return reply.content

        return fetch

    async def read() -> bytes:
        return await asyncio.to_thread(_newest, settings)

    return read


def _newest(settings: PictureSection) -> bytes:
    path = settings.file or _latest(settings)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise NoPictureError(str(error)) from error
    if not data:
        raise NoPictureError(f"{path} is empty")
    return data


def _latest(settings: PictureSection) -> Path:
    assert settings.folder is not None
    try:
        files = [
            (path.stat().st_mtime, path)
            for path in settings.folder.glob(settings.pattern)
            if path.is_file()
        ]
    except OSError as error:
        raise NoPictureError(str(error)) from error
    if not files:
        raise NoPictureError(f"{settings.folder} has no file that matches {settings.pattern}")
    changed, path = max(files)
    if settings.most_age_s is not None and time.time() - changed > settings.most_age_s:
        raise NoPictureError(f"{path} is older than {settings.most_age_s:g} s")
    return path
