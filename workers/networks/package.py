"""The file of a network: a ZIP archive of ``card.json`` and ``network.onnx``, stored as they are.

What is read here may come from anywhere, so sizes are looked at before anything is taken out.
Whether the weights are of any use is for a worker's child to find out
(:mod:`workers.stages.import_network`).
"""

from __future__ import annotations

import hashlib
import io
import zipfile

from dlo_client.contracts.networks import NetworkCard
from pydantic import ValidationError

CARD, WEIGHTS = "card.json", "network.onnx"
SUFFIX = ".dlonet"
_MOST_CARD_BYTES = 64 * 1024
_EPOCH = (1980, 1, 1, 0, 0, 0)


class PackageError(ValueError):
    """The bytes are no network file; the message states what is wrong with them."""


def pack(card: NetworkCard, onnx: bytes) -> bytes:
    """The same bytes for the same network."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:
        for name, data in ((CARD, card.model_dump_json(indent=1).encode()), (WEIGHTS, onnx)):
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), data)
    return out.getvalue()


def unpack(data: bytes, most_bytes: int) -> tuple[NetworkCard, bytes]:
    """The card and the ONNX file of at most ``most_bytes``. Raises PackageError."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            card = _member(archive, CARD, _MOST_CARD_BYTES)
            onnx = _member(archive, WEIGHTS, most_bytes)
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise PackageError(f"is no network file: {error}") from error
    try:
        read = NetworkCard.model_validate_json(card)
    except ValidationError as error:
        first = error.errors()[0]
        raise PackageError(f"{CARD}: {'.'.join(map(str, first['loc']))}: {first['msg']}") from error
    if hashlib.sha256(onnx).hexdigest() != read.sha256:
        raise PackageError(f"{WEIGHTS} is not the file that {CARD} names")
    return read, onnx


def _member(archive: zipfile.ZipFile, name: str, most_bytes: int) -> bytes:
    found = [info for info in archive.infolist() if info.filename == name]
    if len(found) != 1:
        raise PackageError(f"holds {len(found) or 'no'} {name}")
    if found[0].file_size > most_bytes:
        raise PackageError(f"{name} has more than {most_bytes} bytes")
    with archive.open(found[0]) as member:
        data = member.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise PackageError(f"{name} has more than {most_bytes} bytes")
    return data
