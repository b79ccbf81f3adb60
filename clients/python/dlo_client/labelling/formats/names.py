"""Names of exported files: pictures that differ by their suffix, or by a folder's spelling, do not
share one."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import PurePosixPath


def told_apart(
    names: Iterable[str], short: Callable[[str], str], long: Callable[[str], str]
) -> dict[str, str]:
    """Picture → name of its file: the short one, where two are alike the long one, with a digest
    where that is taken too.

    Names that differ only by case are alike: not every file system tells them apart. The same names
    give the same files.
    """
    brief = {name: short(name) for name in sorted(set(names))}
    full = {name: long(name) for name in brief}
    briefs, fulls = (Counter(text.casefold() for text in of.values()) for of in (brief, full))
    files = {}
    for name, text in brief.items():
        if briefs[text.casefold()] > 1:
            text = full[name]
            if fulls[text.casefold()] > 1 or text.casefold() in briefs:
                text = f"{text}-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
        files[name] = text
    return files


def stem(name: str) -> str:
    """The path without the suffix."""
    return str(PurePosixPath(name).with_suffix(""))


def stem_and_suffix(name: str) -> str:
    """``a/cam.jpg`` → ``a/cam_jpg``"""
    return f"{stem(name)}_{PurePosixPath(name).suffix.lstrip('.').lower()}"
