"""COCO's compressed run-length masks, encoded and decoded.

A mask is read down its columns. Its runs alternate background, foreground, background … (the first
may be empty). From the fourth run on, the difference to the run two places before is stored. Each
number becomes 5-bit groups, lowest first, in two's complement; bit 6 is set where more groups
follow; 48 makes it printable.
"""

from __future__ import annotations

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, IntArray

_GROUPS = 7  # 35 bits: enough for every run of a mask of up to 2**33 pixels
_SHIFTS = 5 * np.arange(_GROUPS + 1, dtype=np.int64)


def encode(mask: BoolArray) -> str:
    """Run-length string of an ``(H, W)`` mask. An empty array gives ``""``."""
    return encode_labels(np.asarray(mask, dtype=bool).view(np.uint8), 1)[0]


def encode_labels(labels: ByteArray, count: int) -> list[str]:
    """Run-length strings of the masks ``labels == 1`` to ``labels == count``, from one pass over
    ``(H, W)``."""
    if labels.size == 0:
        return [""] * count
    pixels = labels.ravel(order="F")
    bounds = np.concatenate(([0], np.flatnonzero(pixels[1:] != pixels[:-1]) + 1, [pixels.size]))
    values = pixels[bounds[:-1]]
    strings = []
    for number in range(1, count + 1):
        mine = np.flatnonzero(values == number)
        changes = np.stack((bounds[mine], bounds[mine + 1]), axis=1).ravel()
        runs = np.diff(np.concatenate(([0], changes, [pixels.size])))
        strings.append(_pack(runs[:-1] if len(runs) > 1 and runs[-1] == 0 else runs))
    return strings


def decode(counts: str, size: tuple[int, int]) -> BoolArray:
    """``(H, W)`` mask of a run-length string. Raises ``ValueError`` if the runs do not fill
    ``size``."""
    runs = _unpack(counts)
    height, width = size
    if runs.min(initial=0) < 0 or runs.sum() != height * width:
        raise ValueError(f"the runs do not make a mask of {height}x{width} pixels")
    values = np.arange(len(runs)) % 2 == 1
    return np.ascontiguousarray(np.repeat(values, runs).reshape(width, height).T)


def _pack(runs: IntArray) -> str:
    numbers = runs.copy()
    numbers[3:] -= runs[1:-2]
    groups = (numbers[:, None] >> _SHIFTS[:-1]) & 0x1F
    # A number is complete when only its sign is left, and the group's top bit already shows that
    # sign.
    left = numbers[:, None] >> _SHIFTS[1:]
    complete = left == -(groups >> 4)
    used = np.arange(_GROUPS) <= np.argmax(complete, axis=1)[:, None]
    codes = groups + 0x20 * ~complete + 48
    text: str = codes[used].astype(np.uint8).tobytes().decode("ascii")
    return text


def _unpack(counts: str) -> IntArray:
    codes = np.frombuffer(counts.encode("ascii"), dtype=np.uint8).astype(np.int64) - 48
    last = np.flatnonzero((codes & 0x20) == 0)
    if len(codes) and (
        codes.min() < 0 or codes.max() > 63 or len(last) == 0 or last[-1] != len(codes) - 1
    ):
        raise ValueError("not a compressed run-length string")
    first = np.concatenate(([0], last[:-1] + 1)).astype(np.int64)[: len(last)]
    place = np.arange(len(codes)) - np.repeat(first, last - first + 1)
    if place.max(initial=0) >= _GROUPS:
        raise ValueError("a run is longer than any mask")
    numbers: IntArray = (
        np.add.reduceat((codes & 0x1F) << (5 * place), first) if len(last) else first
    )
    negative = codes[last] & 0x10 != 0
    numbers = numbers - (negative.astype(np.int64) << (5 * (place[last] + 1)))
    for parity in (
        1,
        2,
    ):  # undo the differences: run k is the sum of numbers k, k - 2, … down to 1 or 2
        numbers[parity::2] = np.cumsum(numbers[parity::2])
    return numbers
