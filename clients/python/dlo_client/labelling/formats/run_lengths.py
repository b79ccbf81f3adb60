"""COCO's run lengths, read without trust: the library would read or write past the end of what does
not fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dlo_client.contracts import MaskRLE
from dlo_client.labelling.formats.exchange import Refused
from dlo_client.labelling.formats.pixels import Mask, decode

_NOT_FILLED = "the run lengths do not fill the picture"


def mask_of_runs(counts: object, height: int, width: int) -> Mask:
    """(H, W) mask of a compressed string or a plain list of runs down the columns. Raises
    Refused."""
    if isinstance(counts, bytes):
        counts = counts.decode("ascii", "replace")
    if isinstance(counts, str):
        check(counts, height, width)
        return decode(MaskRLE(size=(height, width), counts=counts))
    if not isinstance(counts, list):
        raise Refused("a mask's run lengths are neither a string nor a list")
    runs = runs_of(counts, height * width)
    return np.asarray(np.repeat(np.arange(len(runs)) % 2 == 1, runs).reshape(width, height).T)


def check(counts: str, height: int, width: int) -> None:
    """Raises Refused unless the runs of a compressed string fill the picture."""
    if sum(_runs(counts, height * width)) != height * width:
        raise Refused(_NOT_FILLED)


def runs_of(values: Sequence[object], total: int) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Whole numbers of 0 or more that sum up to ``total``. Raises Refused."""
    if len(values) > 2 * total + 2:
        raise Refused(_NOT_FILLED)
    try:
        given = np.asarray(values, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise Refused("a mask's run lengths are no numbers") from error
    if given.ndim != 1 or not ((given >= 0) & (given <= total) & (given == np.floor(given))).all():
        raise Refused(f"{_NOT_FILLED}: each is a whole number from 0 to {total}")
    runs = given.astype(np.int64)
    if runs.sum() != total:
        raise Refused(_NOT_FILLED)
    return runs


def _runs(counts: str, total: int) -> list[int]:
    """The runs of COCO's compressed string: 5 bits a character, bit 6 for more, from the fourth run
    on differences."""
    if len(counts) > 14 * (total + 1):
        raise Refused(_NOT_FILLED)
    runs: list[int] = []
    value = shift = 0
    for character in counts.encode("utf-8", "replace"):
        code = character - 48
        if not 0 <= code < 64 or shift > 30:
            raise Refused("no run-length string")
        value |= (code & 0x1F) << shift
        shift += 5
        if not code & 0x20:
            value -= (code & 0x10) << (shift - 4)
            runs.append(value + (runs[-2] if len(runs) > 2 else 0))
            value = shift = 0
            if not 0 <= runs[-1] <= total:
                raise Refused("a run length is negative or longer than the picture")
    if shift:
        raise Refused("the run-length string is cut short")
    return runs
