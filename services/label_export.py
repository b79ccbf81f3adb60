"""Labels in the formats of other tools: written by the SDK in a process of its own, answered as an
archive."""

from __future__ import annotations

import asyncio
import io
import resource
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Literal

from anyio import CapacityLimiter, to_thread
from dlo_client.labelling.labels import PictureLabel
from pydantic import ValidationError

from services.problems import ProblemError, field_error

ExportFormat = Literal["coco", "coco-polygons", "cvat", "label-studio", "png", "yolo", "json"]
"""YOLO's folder holds the pictures too: ``images.json`` in its archive states where each of them
belongs."""
MEDIA_TYPE = "application/zip"

_AT_ONCE = 1
_WITHIN_S = 120.0
_MEMORY_BYTES = 2 * 1024**3
_NOT_INSTALLED = 3
_LONGEST_REASON = 300


class LabelExports:
    """Writes one archive at a time."""

    def __init__(self) -> None:
        self._limiter = CapacityLimiter(_AT_ONCE)

    async def archive(self, name: ExportFormat, lines: bytes) -> bytes:
        """A ZIP of what the format's writer makes of labels, one in each line. Raises
        ProblemError."""
        await to_thread.run_sync(_check, lines)
        async with self._limiter:
            with tempfile.TemporaryDirectory(prefix="labels-") as folder:
                source, out = Path(folder) / "labels.jsonl", Path(folder) / "out"
                out.mkdir()
                await to_thread.run_sync(source.write_bytes, lines)
                await _written(name, source, out)
                return await to_thread.run_sync(_packed, out)


def _check(lines: bytes) -> None:
    """What is no label starts no process."""
    given = [line for line in lines.split(b"\n") if line.strip()]
    if not given:
        raise field_error("labels", "there is no line with a label")
    for number, line in enumerate(given, start=1):
        try:
            PictureLabel.model_validate_json(line)
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            place = ".".join(str(step) for step in first["loc"])
            raise field_error(
                "labels", f"line {number} is no label: {place} {first['msg']}"
            ) from None


async def _written(name: ExportFormat, source: Path, out: Path) -> None:
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        "-m",
        "dlo_client.labelling.convert",
        name,
        str(source),
        str(out),
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.PIPE,
        preexec_fn=_limited,
    )
    try:
        async with asyncio.timeout(_WITHIN_S):
            _, told = await process.communicate()
    except TimeoutError:
        process.kill()
        await process.wait()
        raise field_error(
            "labels", f"took longer than {_WITHIN_S:g} s to write", status=422
        ) from None
    if process.returncode == 0:
        return
    reason = told.decode(errors="replace").strip()[-_LONGEST_REASON:]
    if process.returncode == _NOT_INSTALLED:
        raise ProblemError(501, "not_installed", f"{reason}; install it beside the service")
    raise field_error("labels", reason or "cannot be written in this format")


def _limited() -> None:
    resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY_BYTES, resource.RLIM_INFINITY))


def _packed(folder: Path) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(file for file in folder.rglob("*") if file.is_file()):
            archive.write(file, file.relative_to(folder))
    return buffer.getvalue()
