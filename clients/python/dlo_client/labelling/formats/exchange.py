"""What all formats share: what a reader hands over, and files written whole."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from dlo_client.labelling.labels import PictureLabel

Labels = Callable[[], Iterable[PictureLabel]]
CLASS = "dlo"


class FormatError(ValueError):
    """A file is not of the format, or broken beyond one picture; the message states where."""


class Refused(ValueError):
    """One picture of a file cannot be taken; the message states why."""


@dataclass
class Imported:
    """What a file holds. ``labels``: what could be read; ``problems``: picture, or place in the
    file, and why it was refused; ``not_annotated``: picture and why nobody's work is in it;
    ``notes``: what was left out or changed in pictures that were read, and how often in each;
    ``taken``: shapes of a wanted class; ``others``: picture and the classes in it that are not
    wanted."""

    labels: list[PictureLabel] = field(default_factory=list)
    problems: dict[str, str] = field(default_factory=dict)
    not_annotated: dict[str, str] = field(default_factory=dict)
    notes: dict[str, dict[str, int]] = field(default_factory=dict)
    taken: int = 0
    others: dict[str, set[str]] = field(default_factory=dict)

    def refuse(self, place: str, why: str) -> None:
        """A second problem at a place of the same name is kept beside the first."""
        key, count = place, 1
        while key in self.problems:
            count += 1
            key = f"{place} ({count})"
        self.problems[key] = why

    def note(self, what: str, picture: str, count: int = 1) -> None:
        pictures = self.notes.setdefault(what, {})
        pictures[picture] = pictures.get(picture, 0) + count

    @contextmanager
    def one_picture(self, place: str) -> Iterator[None]:
        """Whatever is wrong inside costs this picture alone."""
        try:
            yield
        except Refused as error:
            self.refuse(place, str(error))
        except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
            self.refuse(place, f"cannot be read: {type(error).__name__}: {str(error)[:200]}")


@contextmanager
def written_whole(file: Path) -> Iterator[IO[str]]:
    """A text file that takes its place when it is complete."""
    file.parent.mkdir(parents=True, exist_ok=True)
    partial = file.with_name(f".{file.name}.part")
    try:
        with partial.open("w", encoding="utf-8") as out:
            yield out
        partial.replace(file)
    finally:
        partial.unlink(missing_ok=True)


def write_list(out: IO[str], items: Iterable[Any]) -> None:
    """A JSON list, item by item."""
    out.write("[")
    for k, item in enumerate(items):
        out.write(",\n" if k else "\n")
        json.dump(item, out, ensure_ascii=False)
    out.write("]")


def read_json(file: Path) -> Any:
    """A JSON file, with or without a byte-order mark. Raises FormatError."""
    try:
        return json.loads(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise FormatError(f"{file}: {error}") from error
