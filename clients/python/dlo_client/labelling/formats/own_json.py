"""Our own format: a JSON line a picture, with all that the service answered."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from dlo_client.labelling.formats.exchange import FormatError, Imported, Labels, written_whole
from dlo_client.labelling.formats.gate import Wanted, checked
from dlo_client.labelling.labels import PictureLabel


def write(labels: Labels, out: Path) -> Path:
    """``labels.jsonl``."""
    file = out / "labels.jsonl"
    with written_whole(file) as lines:
        lines.writelines(label.model_dump_json() + "\n" for label in labels())
    return file


def read(path: Path, wanted: Wanted = Wanted()) -> Imported:  # noqa: B008
    """A line that is no label costs that picture alone. Raises FormatError when the file cannot be
    read."""
    try:
        lines = path.read_text(encoding="utf-8-sig").split("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{path}: {error}") from error
    imported = Imported()
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        try:
            label = PictureLabel.model_validate_json(line)
        except ValidationError as error:
            imported.refuse(f"line {number}", f"no label: {error.errors()[0]['msg']}")
            continue
        with imported.one_picture(label.name):
            imported.labels.append(checked(label, imported))
    return imported
