"""Pages of the viewer in a real browser, against a stand-in for the service."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.clients import samples
from tests.clients.fake_service import FakeService, served

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
NEEDS_BROWSER = [
    pytest.mark.system,
    pytest.mark.browser,
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"needs a browser at {CHROMIUM}"),
]


@contextmanager
def opened(browser: Any, service: FakeService, path: str = "", height: int = 900) -> Iterator[Any]:
    """The page at this path of the service; an error on it or a request to another host fails the test."""
    wrong: list[str] = []
    with served(service.app()) as url:
        page = browser.new_page(viewport={"width": 1300, "height": height})
        page.set_default_timeout(30_000)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: request.url.startswith((url, "blob:")) or wrong.append(request.url))
        page.goto(f"{url}/{path}")
        yield page
        page.close()
    assert wrong == []


def color_at(page: Any, x: float, y: float) -> list[int]:
    """RGB on the canvas at a point of the picture."""
    place = [(x + 0.5) / samples.WIDTH, (y + 0.5) / samples.HEIGHT]
    script = """([u, v]) => {
        const canvas = document.querySelector("#canvas");
        const at = [Math.floor(u * canvas.width), Math.floor(v * canvas.height)];
        return [...canvas.getContext("2d").getImageData(...at, 1, 1).data].slice(0, 3);
    }"""
    return page.evaluate(script, place)
