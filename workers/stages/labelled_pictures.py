"""An archive of labelled pictures to the files that a training reads."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path

import cv2
import numpy as np
from dlo_client.contracts.networks import UploadRef
from numpy.typing import NDArray

from workers.blobs import BlobMissing
from workers.labelled_pictures import ArchiveError, Labelled, pairs_of
from workers.pictures.decoding import decode
from workers.pictures.headers import PictureError
from workers.pictures.photographs import rgb_of
from workers.stages.outcome import InvalidInput, Tools

_LONGEST_PX = 1920
"""Larger pictures are reduced: no network sees more."""
_DONE = "unpacked"
INVALID = "invalid_labels"


def unpacked(labels: UploadRef, folder: Path, tools: Tools) -> int:
    """``imgs/NAME.png`` and ``masks/NAME.png`` (255 cable) below ``folder``; how many. Nothing if
    they are there.

    Raises InvalidInput naming ``labels`` and the picture.
    """
    done = folder / _DONE
    if done.exists():
        return int(done.read_text())
    try:
        data = tools.blobs.get(labels.id)
        pairs = pairs_of(data)
    except BlobMissing as error:
        raise InvalidInput(
            "labels", "they have expired: upload them again", "unknown_labels"
        ) from error
    except ArchiveError as error:
        raise InvalidInput("labels", str(error), INVALID) from error
    for part in ("imgs", "masks"):
        (folder / part).mkdir(exist_ok=True)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for number, pair in enumerate(pairs):
            _write(
                folder,
                f"{number:04d}__{pair.name.replace('/', '__')[-80:]}",
                *_read(archive, pair, tools),
            )
    done.write_text(str(len(pairs)))
    return len(pairs)


def _read(
    archive: zipfile.ZipFile, pair: Labelled, tools: Tools
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """(H, W, 3) and (H, W) 0 or 255."""
    try:
        rgb, _ = rgb_of(decode(archive.read(pair.picture), max_pixels=tools.max_image_pixels))
        ids = decode(archive.read(pair.ids), max_pixels=tools.max_image_pixels).values
    except (PictureError, zipfile.BadZipFile, NotImplementedError, EOFError) as error:
        raise InvalidInput("labels", f"{pair.name}: {error}", INVALID) from error
    mask = (ids if ids.ndim == 2 else ids[:, :, :3].max(axis=2)) != 0
    if mask.shape != rgb.shape[:2]:
        (height, width), (rows, columns) = rgb.shape[:2], mask.shape
        text = f"{pair.name}: the picture is {width} × {height}, its label {columns} × {rows}"
        raise InvalidInput("labels", text, INVALID)
    return rgb, mask.astype(np.uint8) * 255


def _write(folder: Path, name: str, rgb: NDArray[np.uint8], mask: NDArray[np.uint8]) -> None:
    factor = _LONGEST_PX / max(mask.shape)
    if factor < 1:
        size = round(mask.shape[1] * factor), round(mask.shape[0] * factor)
        rgb = np.asarray(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), np.uint8)
        mask = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    for part, pixels in (("imgs", rgb[:, :, ::-1]), ("masks", mask)):
        if not cv2.imwrite(str(folder / part / f"{name}.png"), pixels):
            raise OSError(f"{name}.png cannot be written")
