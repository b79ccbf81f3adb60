"""Whether a JPEG is whole: from its markers, and from its compressed data."""

from __future__ import annotations

import io
import re
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

_MARKER = re.compile(rb"\xff+([^\x00\xff\xd0-\xd7])", re.DOTALL)
"""A marker inside compressed data, where 0xFF is followed by 0 unless it starts one; restarts are
passed over."""
_START, _END, _SCAN = 0xD8, 0xD9, 0xDA
_PROGRESSIVE = (0xC2, 0xC6, 0xCA, 0xCE)
_ALONE = (0x01, *range(0xD0, 0xD9))
_SAMSUNG_TRAILER = b"SEFT"
_BLOCK = 8
_FLAT = 2


@dataclass(frozen=True)
class Layout:
    """Where the compressed data of the first picture end, and whether an end marker stands
    there."""

    end: int
    marked: bool
    progressive: bool


def layout(data: bytes) -> Layout | None:
    """From the markers alone; None when there is no scan, or the file stops in the middle of a
    segment."""
    at, progressive, scanned = 2, False, False
    while at + 2 <= len(data):
        if data[at] != 0xFF:
            return Layout(at, False, progressive) if scanned else None
        kind = data[at + 1]
        if kind == 0xFF:
            at += 1
            continue
        if kind == _END:
            return Layout(at, True, progressive) if scanned else None
        if kind in _ALONE:
            at += 2
            continue
        if at + 4 > len(data):
            break
        progressive |= kind in _PROGRESSIVE
        at += 2 + int(struct.unpack_from(">H", data, at + 2)[0])
        if kind == _SCAN and at < len(data):
            scanned = True
            found = _MARKER.search(data, at)
            at = found.start() if found else len(data)
    return Layout(min(at, len(data)), False, progressive) if scanned else None


def ends(data: bytes) -> bool:
    """Whether the first picture of a JPEG has its end: a marker, or the trailer of cameras that
    leave it out."""
    found = layout(data)
    return found is not None and (found.marked or data.endswith(_SAMSUNG_TRAILER))


def is_whole(data: bytes, picture: Image.Image) -> bool:
    """Whether every part of ``picture``, as decoded and not yet turned, comes from ``data``.

    Strategy: libjpeg fills missing data with flat gray and only warns. Where the last block is not
    flat the data reached it. Where it is flat, random bytes are put at the end of the data: a whole
    picture does not change, as what follows its last block is passed over; a cut one does.
    """
    found = layout(data)
    if found is None:
        return False
    if found.marked and not found.progressive and not _last_block_is_flat(picture):
        return True
    scans, end = data[: found.end], b"\xff\xd9"
    as_sent, filled = (
        _reduced(d, found.progressive) for d in (scans + end, scans + _filler() + end)
    )
    return np.array_equal(as_sent, filled)


def _last_block_is_flat(picture: Image.Image) -> bool:
    """In luma, and in its last rows: chroma of the blocks above is mixed into the first ones."""
    left, top = ((side - 1) // _BLOCK * _BLOCK for side in picture.size)
    last_rows = picture.crop((left, max(top, picture.height - _BLOCK // 2), *picture.size)).convert(
        "L"
    )
    return bool(np.ptp(np.asarray(last_rows)) <= _FLAT)


def _filler() -> bytes:
    """Random data without markers, then every restart marker with data of its own."""
    random = np.random.default_rng(0)
    blocks = [random.integers(0, 255, 512, np.uint8).tobytes() for _ in range(9)]
    return blocks[0] + b"".join(
        bytes((0xFF, 0xD0 + k)) + block for k, block in enumerate(blocks[1:])
    )


def _reduced(data: bytes, progressive: bool) -> NDArray[np.uint8]:
    """The means of blocks are enough for a sequential picture; later scans of a progressive one
    refine all."""
    with Image.open(io.BytesIO(data), formats=("JPEG",)) as picture:
        if not progressive:
            picture.draft(picture.mode, (max(1, picture.width // 8), max(1, picture.height // 8)))
        return np.asarray(picture)
