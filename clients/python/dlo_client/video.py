"""Pictures of a video or a folder in, a film with the tracked cables out. Needs OpenCV:
``dlo-client[label]``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import cv2
import numpy as np
from numpy.typing import NDArray

from dlo_client.contracts import FrameResult, TrackedCable
from dlo_client.errors import InvalidArgument
from dlo_client.labelling.sources import SourceError, find_pictures

_COLORS = (
    (230, 60, 60),
    (60, 180, 75),
    (70, 110, 240),
    (240, 190, 20),
    (200, 70, 220),
    (40, 200, 210),
    (245, 130, 40),
)
"""RGB, by the id."""
_FOURCC = "mp4v"
_FPS = 25.0
_OUTLINE = (0, 0, 0)


class Shot(NamedTuple):
    """One picture: its bytes as they travel, its pixels (H, W, 3) BGR, its name and, in a video,
    its time."""

    data: bytes
    pixels: NDArray[np.uint8]
    name: str
    time_s: float | None


def shots(source: str | Path, every: int = 1) -> tuple[Iterator[Shot], float]:
    """Every ``every``-th picture of a video file, or of a folder (or a pattern) in the order of
    names, and how many of them there are a second.

    Raises InvalidArgument for what is neither, OSError for a picture that cannot be read.
    """
    path = Path(source)
    if path.is_file():
        video = cv2.VideoCapture(str(path))
        if video.isOpened() and video.get(cv2.CAP_PROP_FRAME_COUNT) > 1:
            rate = video.get(cv2.CAP_PROP_FPS) or _FPS
            return _of_video(video, every), rate / every
    try:
        pictures = find_pictures(source)
    except SourceError as error:
        raise InvalidArgument("source", f"is neither a video nor pictures: {error}") from error
    return (_read(picture.read(), picture.name) for picture in pictures[::every]), _FPS


def _of_video(video: cv2.VideoCapture, every: int) -> Iterator[Shot]:
    rate, number = video.get(cv2.CAP_PROP_FPS) or _FPS, 0
    while True:
        there, pixels = video.read()
        if not there:
            video.release()
            return
        if number % every == 0:
            _, data = cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])
            yield Shot(
                data.tobytes(), np.asarray(pixels, np.uint8), f"frame_{number:06d}", number / rate
            )
        number += 1


def _read(data: bytes, name: str) -> Shot:
    pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:
        raise OSError(f"{name} is no picture that can be read")
    return Shot(data, np.asarray(pixels, np.uint8), name, None)


class Film:
    """A video file, opened with its first picture; others of another size are fitted to it."""

    def __init__(self, path: Path, fps: float) -> None:
        self._path, self._fps = path, fps
        self._writer: cv2.VideoWriter | None = None
        self._size = (0, 0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._writer is not None:
            self._writer.release()

    def add(self, pixels: NDArray[np.uint8]) -> None:
        """(H, W, 3) BGR. Raises OSError if the file cannot be written."""
        if self._writer is None:
            height, width = pixels.shape[:2]
            self._size = (width - width % 2, height - height % 2)
            code = cv2.VideoWriter.fourcc(*_FOURCC)
            self._writer = cv2.VideoWriter(str(self._path), code, self._fps, self._size)
            if not self._writer.isOpened():
                raise OSError(f"{self._path} cannot be written")
        width, height = self._size
        fits = pixels.shape[:2] == (height, width)
        self._writer.write(np.ascontiguousarray(pixels if fits else cv2.resize(pixels, self._size)))


def drawn(pixels: NDArray[np.uint8], frame: FrameResult) -> NDArray[np.uint8]:
    """A copy of ``pixels`` (H, W, 3) BGR with every cable that is in view, its covered parts
    dotted, and its id."""
    picture = pixels.copy()
    for cable in frame.cables:
        if cable.state != "lost":
            _draw(picture, cable)
    return picture


def _draw(picture: NDArray[np.uint8], cable: TrackedCable) -> None:
    color = _COLORS[cable.id % len(_COLORS)][::-1]
    points = np.rint(np.array(cable.centerline_xy)).astype(np.int32)
    u = np.linspace(0.0, 1.0, len(points))
    hidden = np.zeros(len(points), bool)
    for first, last in cable.covered:
        hidden |= (u >= first - 1e-3) & (u <= last + 1e-3)
    for k in range(len(points) - 1):
        if not hidden[k] and not hidden[k + 1]:
            cv2.line(picture, points[k].tolist(), points[k + 1].tolist(), color, 2, cv2.LINE_AA)
    for point in points[hidden]:
        cv2.circle(picture, point.tolist(), 1, color, -1)
    at = points[~hidden][(~hidden).sum() // 3] if not hidden.all() else points[0]
    for thickness, paint in ((3, _OUTLINE), (1, color)):
        cv2.putText(
            picture,
            str(cable.id),
            at.tolist(),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.6,
            paint,
            thickness,
            cv2.LINE_AA,
        )
