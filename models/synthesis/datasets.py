"""Labelled pictures in folders, and mixing several of them by ratio (thesis 2.7.2, eq. 2.5).

A set is a folder. Its pictures are NAME.png, NAME.jpg or NAME.jpeg, in the folder itself or in
``imgs/``; the truth of each is NAME_ids.png beside it, or ``masks/NAME.*``, or ``labels/NAME.*``: 0
is background, all else DLO (an instance id, a class or 255). With an ``index.jsonl``, one JSON
object with a ``name`` per line, only the names in it belong to the set: it is written last, so a
set whose writing was cut off stays valid. What ``python -m models.synthesis render`` and
``models.synthesis.chroma_key`` write can be read, and so can real pictures with hand-made masks.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

INDEX = "index.jsonl"
_PICTURES = (".png", ".jpg", ".jpeg")


class DatasetError(ValueError):
    """A folder is no labelled set; the message names the pictures."""


@dataclass(frozen=True)
class Sample:
    """``image`` and ``truth`` files of the picture ``name``."""

    name: str
    image: Path
    truth: Path


def pictures_in(folder: Path) -> list[Path]:
    """The picture files of ``folder``, sorted; truth files (``_ids``) left out."""
    files = folder.iterdir() if folder.is_dir() else ()
    return sorted(f for f in files if f.suffix.lower() in _PICTURES and not f.stem.endswith("_ids"))


def samples_in(folder: Path) -> list[Sample]:
    """All samples of a set, by name. Raises DatasetError: no pictures, or some without truth."""
    images = pictures_in(folder / "imgs") or pictures_in(folder)
    if (folder / INDEX).exists():
        listed = {record["name"] for record in read_index(folder)}
        images = [image for image in images if image.stem in listed]
    if not images:
        raise DatasetError(f"no labelled pictures in {folder}")
    truths = {image: _truth_of(image, folder) for image in images}
    bare = [image.name for image, truth in truths.items() if truth is None]
    if bare:
        raise DatasetError(f"{len(bare)} pictures in {folder} have no mask: {', '.join(bare[:5])}")
    return [
        Sample(image.stem, image, truth) for image, truth in truths.items() if truth is not None
    ]


def load(sample: Sample, fit: bool = False) -> tuple[NDArray[np.uint8], NDArray[np.bool_]]:
    """Picture (H, W, 3) RGB and foreground (H, W). ``fit`` scales a mask of another size to the
    picture; without it that raises DatasetError, as does a file that is no picture."""
    image, truth = (cv2.imread(str(f), mode) for f, mode in _files(sample))
    if image is None or truth is None:
        raise DatasetError(
            f"{sample.image if image is None else sample.truth} is no readable picture"
        )
    mask = (truth if truth.ndim == 2 else truth[:, :, :3].max(2)) > 0
    if mask.shape != image.shape[:2]:
        if not fit:
            (h, w), (mh, mw) = image.shape[:2], mask.shape
            raise DatasetError(
                f"{sample.truth.name} is {mw}×{mh} but its picture {sample.image.name} is {w}×{h}"
            )
        mask = (
            cv2.resize(mask.astype(np.uint8), image.shape[1::-1], interpolation=cv2.INTER_NEAREST)
            > 0
        )
    return np.ascontiguousarray(image[:, :, ::-1]), mask


def write_sample(folder: Path, name: str, rgb: NDArray[np.uint8], ids: NDArray[Any]) -> None:
    """NAME.png and NAME_ids.png, each whole or not at all. OSError when the disk is full."""
    if ids.shape != rgb.shape[:2]:
        raise DatasetError(f"{name}: ids {ids.shape} for a picture {rgb.shape[:2]}")
    folder.mkdir(parents=True, exist_ok=True)
    for file, pixels in (
        (f"{name}_ids.png", ids.astype(np.uint8)),
        (f"{name}.png", rgb[:, :, ::-1]),
    ):
        # imwrite would report a full disk as a mere False; writing the bytes ourselves raises.
        write_whole(folder / file, cv2.imencode(".png", pixels)[1].tobytes())


def write_whole(file: Path, content: bytes) -> None:
    """Written beside the target and renamed: a reader never sees half a file."""
    temporary = file.with_name(file.name + ".tmp")
    try:
        temporary.write_bytes(content)
        temporary.replace(file)
    finally:
        temporary.unlink(missing_ok=True)


def append_index(folder: Path, record: Mapping[str, Any]) -> None:
    """One line more, once the files of ``record["name"]`` are written. A line that does not fit on
    the disk is taken back, so that the next one does not continue it."""
    file = folder / INDEX
    before = file.stat().st_size if file.exists() else 0
    try:
        with file.open("ab", buffering=0) as lines:
            lines.write((json.dumps(record) + "\n").encode())
    except OSError:
        with file.open("ab") as lines:
            lines.truncate(before)
        raise


def read_index(folder: Path) -> list[dict[str, Any]]:
    """The records written so far; a last line cut off by a crash is dropped, here and in the
    file."""
    file = folder / INDEX
    if not file.exists():
        return []
    content = file.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        write_whole(file, whole)
    return [json.loads(line) for line in whole.splitlines()]


class Mixture:
    """Eq. 2.5: ``F(x) = Σ w_i P_i(x)``, exact in counts: of n drawn, source i gives w_i n, rounded
    by largest remainder. Within a source nothing comes twice before all came once."""

    def __init__(
        self, sizes: Sequence[int], weights: Sequence[float], rng: np.random.Generator
    ) -> None:
        """``sizes`` pictures per source; ``weights`` ratios, scaled to sum 1. ValueError for an
        empty source with weight, a negative weight or none above 0."""
        if len(sizes) != len(weights) or min(weights) < 0 or sum(weights) <= 0:
            raise ValueError("one weight of 0 or more for each source, one of them above 0")
        if any(w > 0 and n == 0 for n, w in zip(sizes, weights, strict=True)):
            raise ValueError("a source with a weight above 0 is empty")
        self.weights = np.asarray(weights, float) / sum(weights)
        self._sizes, self._rng = sizes, rng
        self._waiting: list[list[int]] = [[] for _ in sizes]

    def draw(self, count: int) -> list[tuple[int, int]]:
        """``count`` pairs (source, number in it) in random order."""
        pairs = [
            (s, self._next(s))
            for s, n in enumerate(exact_counts(count, self.weights))
            for _ in range(n)
        ]
        return [pairs[k] for k in self._rng.permutation(len(pairs))]

    def _next(self, source: int) -> int:
        if not self._waiting[source]:
            self._waiting[source] = self._rng.permutation(self._sizes[source]).tolist()
        return self._waiting[source].pop()


def exact_counts(count: int, weights: NDArray[np.float64]) -> list[int]:
    """``count`` split by ``weights`` (sum 1): each floor or floor + 1, the largest remainders
    first."""
    ideal = count * weights
    counts = np.floor(ideal + 1e-9).astype(int)
    rest = np.argsort(counts - ideal, kind="stable")[: count - int(counts.sum())]
    counts[rest] += 1
    return [int(n) for n in counts]


def _truth_of(image: Path, folder: Path) -> Path | None:
    beside = image.with_name(f"{image.stem}_ids.png")
    if beside.exists():
        return beside
    found = (
        folder / part / f"{image.stem}{end}" for part in ("masks", "labels") for end in _PICTURES
    )
    return next((file for file in found if file.exists()), None)


def _files(sample: Sample) -> tuple[tuple[Path, int], tuple[Path, int]]:
    return (sample.image, cv2.IMREAD_COLOR), (sample.truth, cv2.IMREAD_UNCHANGED)
