"""The clips of the tracking bench with their truth and their instances, kept in a folder.

Strategy: rendering a clip and finding its instances takes ten times as long as tracking it, so both are done once. A
file is named by a digest of the parameters and of the code it came from: after a change it is made anew.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import process_time

import cv2
import numpy as np

from models.instances.scene import Scene
from models.instances.section_matching import extract
from models.synthesis.clips import ClipParams, Frame, render_clip
from models.synthesis.scenes import to_uint8
from models.synthesis.textures import TexturePool

FOLDER = Path("build/bench/clips")
_RENDERED = "models/synthesis/clips.py", "models/synthesis/cables.py", "models/synthesis/curves.py"
_FOUND = "models/instances/**/*.py", "models/strands/**/*.py", "models/geometry/**/*.py"
_JPEG_QUALITY = 92
_TUNING, _REPORTED = 47, 31
"""What the seeds of either set begin with: no constant is chosen on a reported clip."""


@dataclass(frozen=True)
class ClipKind:
    """``params`` of its clips, of which no cable is seen in the frames ``hidden`` (start, stop)."""

    params: ClipParams
    hidden: tuple[int, int] = (0, 0)


def kinds(frames: int) -> dict[str, ClipKind]:
    """By name. ``hidden`` shows the clips of ``moving``, but for some frames."""
    half = frames // 2
    moving = ClipParams(frames=frames)
    return {
        "moving": ClipKind(moving),
        "fast": ClipKind(replace(moving, speed=1.5)),
        "covered": ClipKind(replace(moving, covered=(half, half + min(30, frames // 4)))),
        "hidden": ClipKind(moving, hidden=(half, half + min(10, frames // 4))),
    }


@dataclass(frozen=True, eq=False)
class Seen:
    """One frame: ``jpeg`` of its picture, ``mask`` (H, W), the ``scene`` found in both and the CPU seconds that took;
    ``centerlines`` and ``in_view`` as of :class:`models.synthesis.clips.Frame`."""

    jpeg: bytes
    packed: bytes
    scene: Scene
    seconds: float
    centerlines: tuple[np.ndarray, ...]
    in_view: tuple[np.ndarray, ...]

    @property
    def image(self) -> np.ndarray:
        return _decoded(self.jpeg)

    @property
    def mask(self) -> np.ndarray:
        return _decoded(self.packed)[..., 0] > 0

    @property
    def hidden(self) -> Seen:
        """The same moment with nothing in view."""
        nothing = np.zeros_like(self.mask)
        unseen = tuple(np.zeros(len(seen), bool) for seen in self.in_view)
        return replace(
            self,
            packed=_encoded(nothing, ".png"),
            scene=Scene((), (), np.zeros_like(self.scene.labels)),
            in_view=unseen,
        )


def clip(kind: ClipKind, seed: int, tuning: bool, folder: Path = FOLDER) -> Iterator[Seen]:
    """The frames of a clip, from ``folder`` where it has them."""
    seeds = (_TUNING if tuning else _REPORTED, seed)
    path = folder / f"{_digest(kind.params, seeds)}.pickle"
    if not path.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        frames = render_clip(np.random.default_rng(seeds), kind.params, TexturePool(()))
        with path.with_suffix(".part").open("wb") as file:
            for frame in frames:
                pickle.dump(_seen(frame), file)
        path.with_suffix(".part").rename(path)
    with path.open("rb") as file:
        for t in range(kind.params.frames):
            seen = pickle.load(file)  # of our own making, see above
            yield seen.hidden if kind.hidden[0] <= t < kind.hidden[1] else seen


def _seen(frame: Frame) -> Seen:
    jpeg = _encoded(to_uint8(frame.rgb)[..., ::-1], ".jpg")
    mask = frame.ids.numpy() > 0
    started = process_time()
    scene = extract(mask, _decoded(jpeg))
    seconds = process_time() - started
    lines = tuple(line.astype(np.float32) for line in frame.centerlines)
    labels = scene.labels.astype(np.uint8)
    scene = replace(scene, labels=labels)
    return Seen(jpeg, _encoded(mask, ".png"), scene, seconds, lines, frame.in_view)


def _encoded(picture: np.ndarray, form: str) -> bytes:
    values = picture.astype(np.uint8) * (255 if picture.dtype == bool else 1)
    how = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if form == ".jpg" else []
    return cv2.imencode(form, values, how)[1].tobytes()


def _decoded(data: bytes) -> np.ndarray:
    """(H, W, 3) RGB."""
    return np.ascontiguousarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1])


def _digest(params: ClipParams, seeds: tuple[int, int]) -> str:
    found = hashlib.sha256(repr((params, seeds, _JPEG_QUALITY)).encode())
    for pattern in (*_RENDERED, *_FOUND):
        for path in sorted(Path().glob(pattern)):
            found.update(path.read_bytes())
    return found.hexdigest()[:16]
