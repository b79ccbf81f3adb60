"""Every page of the real service in a real browser, under its own security policy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.clients.browser_pages import CHROMIUM, FLAGS, NEEDS_BROWSER
from tests.processes import running_service

pytestmark = NEEDS_BROWSER
PAGES = ["", "viewer/harness.html", "viewer/label.html", "viewer/reconstruction.html", "docs", "redoc"]


@pytest.fixture(scope="module")
def address(tmp_path_factory) -> Iterator[str]:
    with running_service(tmp_path_factory.mktemp("data"), workers=1) as address:
        yield address


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.mark.parametrize("path", PAGES)
def test_a_page_loads_all_that_it_names(address: str, browser: Any, path: str) -> None:
    """The policy forbade the pages' `<base>`: their styles and scripts were looked for in another folder."""
    wrong: list[str] = []
    page = browser.new_page()
    page.set_default_timeout(60_000)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    page.on("response", lambda response: wrong.append(response.url) if response.status >= 400 else None)
    page.goto(f"{address}/{path}")
    page.wait_for_load_state("networkidle")
    page.close()
    assert wrong == []
