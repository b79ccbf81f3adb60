"""What a Dockerfile puts into an image: files, requirements and the entry point of each target."""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

_JOINED = re.compile(r"\\\n\s*")


@dataclass
class Image:
    """One target, with what its base brings."""

    copies: list[tuple[str, str]] = field(default_factory=list)
    runs: list[str] = field(default_factory=list)
    environment: dict[str, str] = field(default_factory=dict)
    user: str = "root"
    command: list[str] = field(default_factory=list)


def images(text: str) -> dict[str, Image]:
    """By the name of their target."""
    found: dict[str, Image] = {}
    current = Image()
    for line in _JOINED.sub(" ", text).splitlines():
        word, _, rest = line.strip().partition(" ")
        match word:
            case "FROM":
                base, _, name = rest.partition(" AS ")
                known = found.get(base, Image())
                current = Image([*known.copies], [*known.runs], {**known.environment}, known.user)
                found[name] = current
            case "COPY":
                source, target = rest.split()
                current.copies.append((source, target))
            case "RUN":
                current.runs.append(rest)
            case "ENV":
                current.environment |= dict(pair.split("=", 1) for pair in rest.split())
            case "USER":
                current.user = rest
            case "CMD":
                current.command = json.loads(rest)
    return found


def ignored(patterns: list[str], path: str) -> bool:
    """By a ``.dockerignore``: the last pattern that covers the path, or a folder above it,
    decides."""
    parts = Path(path).parts
    above = ["/".join(parts[: k + 1]) for k in range(len(parts))]
    decided = False
    for line in patterns:
        name = line.removeprefix("!").removeprefix("**/")
        anywhere = line.startswith("**/")
        covers = (
            any(fnmatch(part, name) for part in parts)
            if anywhere
            else any(fnmatch(one, name) for one in above)
        )
        if covers:
            decided = not line.startswith("!")
    return decided


def copy_into(root: Path, image: Image, target: Path) -> None:
    """As the build does it from the repository at ``root``."""
    patterns = [line for line in (root / ".dockerignore").read_text().splitlines() if line]
    for source, place in image.copies:
        for file in (
            sorted((root / source).rglob("*")) if (root / source).is_dir() else [root / source]
        ):
            relative = file.relative_to(root).as_posix()
            if file.is_file() and not ignored(patterns, relative):
                to = target / place / file.relative_to(root / source)
                to.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(file, to)
