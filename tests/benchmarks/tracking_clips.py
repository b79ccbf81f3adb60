"""The clips of the tracking bench with their truth and their instances, kept in a folder.

Strategy: rendering a clip takes longer than finding its instances, and this longer than tracking
them, so the first two are done once, and kept in a file each. A file is named by a digest of the
parameters and of the code it came from: after a change of the instances the pictures are still
there, after one of the tracker both are.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from time import process_time
from typing import Any

import cv2
import numpy as np

from models.instances.scene import Scene
from models.instances.section_matching import extract
from models.synthesis.clips import ClipParams, Frame, render_clip
from models.synthesis.scenes import to_uint8
from models.synthesis.textures import TexturePool
from tests.benchmarks.rope_courses import RopeCourse

FOLDER = Path("build/bench/clips")
_RENDERED = "models/synthesis/clips.py", "models/synthesis/cables.py", "models/synthesis/curves.py"
_ROPES = "tests/benchmarks/ropes.py", "tests/benchmarks/rope_courses.py"
_FOUND = "models/instances/**/*.py", "models/strands/**/*.py", "models/geometry/**/*.py"
_JPEG_QUALITY = 92
TUNING, REPORTED = 47, 81
"""What the seeds of either set begin with: no constant is chosen on a reported clip."""
STRESS = {"speed": (0.5, 1.0, 1.5, 3.0), "share": (0.2, 0.4, 0.6), "hidden": (5, 10, 30, 60)}
"""Widths a frame at most, the share of all cables that an arm covers, and the frames in which
nothing is seen."""


@dataclass(frozen=True)
class ClipKind:
    """``params`` of its clips, of which no cable is seen in the frames ``hidden`` (start, stop);
    ``number`` is the second part of its clips' seeds; ``ropes`` whether they move as ropes in
    MuJoCo do; ``clips`` how many of them make a set."""

    params: ClipParams
    number: int
    hidden: tuple[int, int] = (0, 0)
    ropes: bool = False
    clips: int = 6


def kinds(frames: int) -> dict[str, ClipKind]:
    """By name. ``hidden`` shows the clips of ``moving``, but for some frames."""
    half = frames // 2
    moving = ClipParams(frames=frames)
    return {
        "moving": ClipKind(moving, 0),
        "fast": ClipKind(replace(moving, speed=1.5), 1, clips=2),
        "covered": ClipKind(replace(moving, covered=(half, half + min(30, frames // 4))), 2),
        "hidden": ClipKind(moving, 0, hidden=(half, half + min(10, frames // 4))),
        "ropes": ClipKind(moving, 3, ropes=True, clips=2),
    }


def stress(frames: int) -> dict[str, dict[float, ClipKind]]:
    """By name of what is made harder, and by how much of it: clips of the same cables."""
    sets = kinds(frames)
    moving, covered, half = sets["moving"], sets["covered"], frames // 2
    made: dict[str, Callable[[float], ClipKind]] = {
        "speed": lambda value: replace(moving, params=replace(moving.params, speed=value)),
        "share": lambda value: replace(covered, params=replace(covered.params, share=value)),
        "hidden": lambda value: replace(moving, hidden=(half, half + int(value))),
    }
    return {
        name: {value: replace(made[name](value), clips=2) for value in values}
        for name, values in STRESS.items()
    }


@dataclass(frozen=True, eq=False)
class Shown:
    """One frame: ``jpeg`` of its picture, ``packed`` mask; ``centerlines`` and ``in_view`` as of
    :class:`models.synthesis.clips.Frame`."""

    jpeg: bytes
    packed: bytes
    centerlines: tuple[np.ndarray, ...]
    in_view: tuple[np.ndarray, ...]

    @property
    def image(self) -> np.ndarray:
        return _decoded(self.jpeg)

    @property
    def mask(self) -> np.ndarray:
        return _decoded(self.packed)[..., 0] > 0


@dataclass(frozen=True, eq=False)
class Seen(Shown):
    """The same with the ``scene`` found in picture and mask, and the CPU seconds that took."""

    scene: Scene
    seconds: float

    @property
    def hidden(self) -> Seen:
        """The same moment with nothing in view."""
        nothing = np.zeros_like(self.mask)
        unseen = tuple(np.zeros(len(seen), bool) for seen in self.in_view)
        scene = Scene((), (), np.zeros_like(self.scene.labels))
        return replace(self, packed=_encoded(nothing, ".png"), scene=scene, in_view=unseen)


def clip(kind: ClipKind, seed: int, tuning: bool, folder: Path = FOLDER) -> Iterator[Seen]:
    """The frames of a clip, from ``folder`` where it has them."""
    seeds = (TUNING if tuning else REPORTED, kind.number, seed)
    pictures = folder / f"{_digest(kind, seeds)}.pictures"
    scenes = pictures.with_suffix(f".{_found_by()}.scenes")
    if not pictures.is_file():
        course = RopeCourse if kind.ropes else None
        frames = render_clip(np.random.default_rng(seeds), kind.params, TexturePool(()), course)
        _write(pictures, (_shown(frame) for frame in frames))
    if not scenes.is_file():
        for stale in folder.glob(f"{pictures.stem}.*.scenes"):
            stale.unlink()
        _write(scenes, (_found(frame) for frame in _read(pictures)))
    for t, (frame, (scene, labels, seconds)) in enumerate(
        zip(_read(pictures), _read(scenes), strict=True)
    ):
        scene = replace(scene, labels=_decoded(labels)[..., 0])
        seen = Seen(frame.jpeg, frame.packed, frame.centerlines, frame.in_view, scene, seconds)
        yield seen.hidden if kind.hidden[0] <= t < kind.hidden[1] else seen


def _write(path: Path, values: Iterable[object]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    with part.open("wb") as file:
        for value in values:
            pickle.dump(value, file)
    part.rename(path)


def _read(path: Path) -> Iterator[Any]:
    with path.open("rb") as file:
        while file.peek(1):
            yield pickle.load(file)  # of our own making, see above


def _shown(frame: Frame) -> Shown:
    jpeg = _encoded(to_uint8(frame.rgb)[..., ::-1], ".jpg")
    lines = tuple(line.astype(np.float32) for line in frame.centerlines)
    return Shown(jpeg, _encoded(frame.ids.numpy() > 0, ".png"), lines, frame.in_view)


def _found(frame: Shown) -> tuple[Scene, bytes, float]:
    """The scene without its labels, these packed, and the CPU seconds it took."""
    mask, image = frame.mask, frame.image
    started = process_time()
    scene = extract(mask, image)
    seconds = process_time() - started
    return (
        replace(scene, labels=np.zeros((1, 1), np.uint8)),
        _encoded(scene.labels, ".png"),
        seconds,
    )


def _encoded(picture: np.ndarray, form: str) -> bytes:
    values = picture.astype(np.uint8) * (255 if picture.dtype == bool else 1)
    how = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY] if form == ".jpg" else []
    return cv2.imencode(form, values, how)[1].tobytes()


def _decoded(data: bytes) -> np.ndarray:
    """(H, W, 3) RGB."""
    return np.ascontiguousarray(
        cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]
    )


def _digest(kind: ClipKind, seeds: tuple[int, ...]) -> str:
    return _of_code(
        repr((kind.params, seeds, _JPEG_QUALITY)), _RENDERED + (_ROPES if kind.ropes else ())
    )


@cache
def _found_by() -> str:
    """Digest of the code that finds instances."""
    return _of_code("", _FOUND)


def _of_code(text: str, patterns: tuple[str, ...]) -> str:
    found = hashlib.sha256(text.encode())
    for pattern in patterns:
        for path in sorted(Path().glob(pattern)):
            found.update(path.read_bytes())
    return found.hexdigest()[:16]
