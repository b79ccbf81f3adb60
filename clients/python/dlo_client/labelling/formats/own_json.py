"""Our own format: a JSON line a picture, with all that the service said."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from dlo_client.labelling.formats.exchange import FormatError, Imported, Labels, written_whole
from dlo_client.labelling.labels import PictureLabel


def write(labels: Labels, out: Path) -> Path:
    """``labels.jsonl``."""
    file = out / "labels.jsonl"
    with written_whole(file) as lines:
        lines.writelines(label.model_dump_json() + "\n" for label in labels())
    return file


def read(path: Path) -> Imported:
    """A line that is no label costs that picture alone. Raises FormatError when the file cannot be read."""
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: {error}") from error
    imported = Imported()
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            imported.labels.append(PictureLabel.model_validate_json(line))
        except ValidationError as error:
            imported.problems[f"line {number}"] = f"no label: {error.errors()[0]['msg']}"
    return imported
