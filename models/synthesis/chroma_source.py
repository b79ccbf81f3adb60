"""The pictures of a recording: a video file or a folder of pictures, one after another."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from models.synthesis.datasets import pictures_in

Rgb = NDArray[np.uint8]


class SourceError(ValueError):
    """The recording cannot be read; the message names the file."""


def frames(source: Path, every: int = 1) -> Iterator[tuple[int, Rgb]]:
    """Number and picture (H, W, 3) RGB of every ``every``-th frame of a video, or picture of a
    folder."""
    if source.is_dir():
        yield from _pictures(source, every)
    else:
        yield from _video(source, every)


def spread(source: Path, every: int, count: int = 12) -> tuple[list[Rgb], int]:
    """``count`` to ``2 count`` pictures spread evenly over the recording (or all of a shorter one),
    and how many there are in all."""
    kept: list[Rgb] = []
    stride, total = 1, 0
    for k, (_, picture) in enumerate(frames(source, every)):
        total = k + 1
        if k % stride == 0:
            kept.append(picture)
        if len(kept) > 2 * count:
            kept, stride = kept[::2], 2 * stride
    return kept, total


def _pictures(folder: Path, every: int) -> Iterator[tuple[int, Rgb]]:
    files = pictures_in(folder)
    if not files:
        raise SourceError(f"no pictures in {folder}")
    for k, file in list(enumerate(files))[::every]:
        picture = cv2.imread(str(file), cv2.IMREAD_COLOR)
        if picture is None:
            raise SourceError(f"{file} is no readable picture")
        yield k, np.ascontiguousarray(picture[:, :, ::-1])


def _video(file: Path, every: int) -> Iterator[tuple[int, Rgb]]:
    video = cv2.VideoCapture(str(file))
    try:
        k = 0
        while video.isOpened() and video.grab():
            if k % every == 0:
                read, picture = video.retrieve()
                if not read:
                    break
                yield k, np.ascontiguousarray(picture[:, :, ::-1])
            k += 1
        if k == 0:
            raise SourceError(f"{file} does not open as a video")
    finally:
        video.release()
