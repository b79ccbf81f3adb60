"""Label Studio's run lengths of brush masks.

A bit stream, high bit first: 32 bits of length (values, four a pixel: red, green, blue, alpha, row
by row), 5 bits of word size - 1, four times 4 bits of a run's size - 1; then runs. A run is a bit
(1: one value repeated, 0: as many values), 2 bits that pick the size, that many bits of length - 1,
and the value or values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dlo_client.labelling.formats.exchange import Refused
from dlo_client.labelling.formats.pixels import Mask

_SIZES = (3, 4, 8, 16)
_WORD = 8
_CHANNELS = 4


def encode_brush(mask: Mask) -> list[int]:
    """Bytes of the stream; every channel is 255 in the mask and 0 outside."""
    flat = mask.ravel()
    bounds = np.concatenate(([0], np.flatnonzero(flat[1:] != flat[:-1]) + 1, [flat.size]))
    parts = [
        f"{_CHANNELS * flat.size:032b}",
        f"{_WORD - 1:05b}",
        *(f"{size - 1:04b}" for size in _SIZES),
    ]
    for start, length in zip(
        bounds[:-1].tolist(), (_CHANNELS * np.diff(bounds)).tolist(), strict=True
    ):
        parts += _runs(length, 255 if flat[start] else 0)
    bits = "".join(parts)
    bits += "0" * (-len(bits) % 8)
    return [int(bits[k : k + 8], 2) for k in range(0, len(bits), 8)]


def decode_brush(data: object, height: int, width: int) -> Mask:
    """(H, W): where alpha is above a half. Raises Refused when the stream is cut short or of
    another size."""
    stream = _Bits(_bytes(data, height * width))
    total = stream.take(32)
    word = stream.take(5) + 1
    sizes = [stream.take(4) + 1 for _ in range(4)]
    if total != _CHANNELS * height * width:
        raise Refused(f"a brush of {total // _CHANNELS} pixels for a picture of {width}×{height}")
    out = np.zeros(total, np.uint8)
    at = 0
    while at < total:
        repeated = stream.take(1)
        end = min(at + 1 + stream.take(sizes[stream.take(2)]), total)
        out[at:end] = stream.take(word) & 255 if repeated else stream.words(end - at, word)
        at = end
    return np.asarray(out.reshape(height, width, _CHANNELS)[:, :, 3] > 127)


def _bytes(data: object, pixels: int) -> NDArray[np.uint8]:
    """Single values take the most room: three bits of length and eight of value each."""
    if not isinstance(data, list) or len(data) > 8 * pixels + 64:
        raise Refused("a brush is no list of bytes, or longer than the picture")
    if not all(isinstance(v, int) and 0 <= v < 256 for v in data):
        raise Refused("a brush has values that are no bytes")
    return np.asarray(data, np.uint8)


def _runs(length: int, value: int) -> list[str]:
    """One run, or several where it is longer than a run can be."""
    parts = []
    while length > 0:
        now = min(length, 1 << _SIZES[-1])
        pick = next(k for k, size in enumerate(_SIZES) if now <= 1 << size)
        parts.append(f"1{pick:02b}{now - 1:0{_SIZES[pick]}b}{value:0{_WORD}b}")
        length -= now
    return parts


class _Bits:
    def __init__(self, data: NDArray[np.uint8]) -> None:
        self._data = np.unpackbits(data)
        self._at = 0

    def take(self, count: int) -> int:
        """The next bits as a number."""
        return int(self._next(count) @ (1 << np.arange(count - 1, -1, -1)))

    def words(self, count: int, size: int) -> NDArray[np.uint8]:
        """As many numbers of ``size`` bits; of a longer one the last eight bits."""
        bits = self._next(count * size).reshape(count, size)
        return np.asarray(bits @ (1 << np.arange(size - 1, -1, -1)) & 255, np.uint8)

    def _next(self, count: int) -> NDArray[np.uint8]:
        piece = self._data[self._at : self._at + count]
        if len(piece) < count:
            raise Refused("the brush's run lengths are cut short")
        self._at += count
        return piece
