"""The documents of the viewer: what is in ``pages``, each within the one frame that all of them
share."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from string import Template
from textwrap import indent

_FOLDER = Path(__file__).parent / "pages"

PAGES = {
    "index": ("pictures", "app"),
    "harness": ("harness", "harness"),
    "reconstruction": ("3D", "reconstruction"),
    "tracks": ("tracks", "tracks"),
    "label": ("labels", "label"),
    "recipes": ("recipes", "recipes"),
    "jobs": ("jobs", "jobs"),
}
"""Title and script of each page."""


@cache
def document(name: str, base: str = "../") -> str:
    """The HTML of a page; ``base`` is where the service's root is, seen from its address."""
    title, script = PAGES[name]
    main = indent((_FOLDER / f"{name}.html").read_text(encoding="utf-8").rstrip(), "    ")
    frame = Template((_FOLDER / "frame.html").read_text(encoding="utf-8"))
    return frame.substitute(title=title, script=script, base=base, main=main)
