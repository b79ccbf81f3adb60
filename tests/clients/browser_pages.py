"""Pages of the viewer in a real browser, against a stand-in for the service."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tests.browser import NEEDS_BROWSER, Chromium
from tests.clients.fake_service import FakeService, served

__all__ = ["NEEDS_BROWSER", "PLACE", "color_at", "opened", "place"]

PLACE = """([x, y]) => {
    const canvas = document.querySelector("#canvas"), box = canvas.getBoundingClientRect();
    const { scale, left, top } = canvas.dataset;
    return [box.left + Number(left) + (x + 0.5) * scale, box.top + Number(top) + (y + 0.5) * scale];
}"""
"""A function in the page: where a point of the picture is in the window, in CSS pixels."""


@contextmanager
def opened(
    browser: Chromium, service: FakeService, path: str = "", height: int = 900
) -> Iterator[Any]:
    """The page at this path of the service; an error on it or a request to another host fails the
    test.

    All pages share a context, which takes seconds to make and to close: each service has a port of
    its own, so what a page keeps is its own too.
    """
    wrong: list[str] = []
    with served(service.app()) as url:
        page = browser.new_page(shared=True, locale="en-US")
        page.set_viewport_size({"width": 1300, "height": height})
        page.set_default_timeout(60_000)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on(
            "request",
            lambda request: request.url.startswith((url, "blob:")) or wrong.append(request.url),
        )
        page.goto(f"{url}/{path}")
        yield page
        browser.put_away(page)
    assert wrong == []


def place(page: Any, x: float, y: float) -> tuple[float, float]:
    """Where a point of the picture is in the window, in CSS pixels."""
    left, top = page.evaluate(PLACE, [x, y])
    return left, top


def color_at(page: Any, x: float, y: float) -> list[int]:
    """RGB on the canvas at a point of the picture."""
    script = """([x, y]) => {
        const canvas = document.querySelector("#canvas"), box = canvas.getBoundingClientRect();
        const at = [x - box.left, y - box.top].map((value) => Math.floor(value * devicePixelRatio));
        return [...canvas.getContext("2d").getImageData(...at, 1, 1).data].slice(0, 3);
    }"""
    return page.evaluate(script, place(page, x, y))
