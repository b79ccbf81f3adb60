"""What tests of the Pictures page have in common: a picture, its analysis, and which layers are
shown."""

from __future__ import annotations

import ast
import io
from typing import Any

import dlo_client
from PIL import ExifTags, Image

from tests.clients import samples

GRAY = 100


def picture() -> dict[str, Any]:
    """A gray JPEG as a file to choose."""
    return jpeg(Image.new("L", (samples.WIDTH, samples.HEIGHT), GRAY))


def jpeg(image: Image.Image, orientation: int = 1) -> dict[str, Any]:
    data = io.BytesIO()
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    image.save(data, "JPEG", exif=exif)
    return {"name": "it's.jpg", "mimeType": "image/jpeg", "buffer": data.getvalue()}


def analyze(page: Any, file: dict[str, Any] | None = None) -> None:
    page.set_input_files("#file", file or picture())
    page.wait_for_selector("#instances button")


def show_only(page: Any, *layers: str) -> None:
    for name in ("mask", "centerlines", "endpoints", "crossings", "numbers", "unsure"):
        page.set_checked(f"input[name={name}]", name in layers)


def request_in(page: Any) -> tuple[str, ast.Call]:
    """The request's class and the call of ``client.run`` in the page's Python program; the SDK has
    what it imports."""
    program = ast.parse(page.text_content("#python"))
    imported = [name.name for name in program.body[0].names]
    assert all(hasattr(dlo_client, name) for name in imported)
    calls = [node for node in ast.walk(program) if isinstance(node, ast.Call)]
    return imported[-1], next(call for call in calls if getattr(call.func, "attr", "") == "run")
