"""What a job leaves in a folder: ``<picture>.result.json`` and ``<picture>.<file>`` for each of its
files."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from dlo_client.client import Client
from dlo_client.contracts import Job
from dlo_client.outcomes import result_of


def save(client: Client, job: Job[Any], folder: Path, stem: str) -> list[Path]:
    """Write the result and the files of a successful job; returns the paths written."""
    folder.mkdir(parents=True, exist_ok=True)
    contents = {"result.json": result_of(job).model_dump_json(indent=2).encode()}
    contents |= {Path(file.name).name: client.file(job, file.name) for file in job.files}
    saved = []
    for name, content in contents.items():
        path = folder / f"{stem}.{name}"
        path.write_bytes(content)
        saved.append(path)
    return saved


def stems(images: Sequence[Path]) -> list[str]:
    """A name for each picture: its file name without suffix, numbered where pictures share one."""
    seen: Counter[str] = Counter()
    names = []
    for image in images:
        seen[image.stem] += 1
        count = seen[image.stem]
        names.append(image.stem if count == 1 else f"{image.stem}-{count}")
    return names
