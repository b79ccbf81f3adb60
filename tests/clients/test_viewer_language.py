"""German is loaded for who reads it, and nobody who does sees the page in English, or bright,
before."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.browser import Chromium
from tests.clients.browser_pages import NEEDS_BROWSER
from tests.clients.fake_service import VIEWER, FakeService, served

pytestmark = NEEDS_BROWSER
TEXTS = "**/viewer/german.js"
SEEN = "getComputedStyle(document.querySelector('h2')).visibility"


@pytest.fixture
def german(browser: Chromium) -> Iterator[Any]:
    """A tab of somebody who reads German and works in the dark."""
    page = browser.new_page(locale="de-DE", color_scheme="dark")
    page.set_default_timeout(60_000)
    yield page
    browser.put_away(page.context)


@pytest.fixture
def url() -> Iterator[str]:
    with served(FakeService().app()) as url:
        yield url


def test_a_german_page_is_not_seen_before_its_texts_are_there(german: Any, url: str) -> None:
    held: list[Any] = []
    patient = (VIEWER / "style.css").read_text().replace("told 0s 3s", "told 0s 600s")
    german.route("**/style.css", lambda route: route.fulfill(body=patient, content_type="text/css"))
    german.route(TEXTS, lambda route: held.append(route))
    german.goto(f"{url}/viewer/jobs.html", wait_until="commit")
    german.wait_for_selector("h2", state="attached")
    assert german.evaluate(SEEN) == "hidden"
    assert german.get_attribute("html", "data-theme") == "dark"
    german.wait_for_function("performance.getEntriesByType('resource').length > 5")
    for route in held:
        route.continue_()
    german.unroute(TEXTS)
    german.wait_for_selector("nav >> text=Aufträge")
    assert german.evaluate(SEEN) == "visible"


def test_a_page_whose_german_is_lost_is_english(german: Any, url: str) -> None:
    german.route(TEXTS, lambda route: route.abort())
    german.goto(f"{url}/viewer/jobs.html")
    german.wait_for_selector("nav >> text=Jobs")
    assert german.evaluate(SEEN) == "visible"


def test_a_page_that_never_runs_is_seen_all_the_same(german: Any, url: str) -> None:
    german.route("**/viewer/jobs.js", lambda route: route.abort())
    german.goto(f"{url}/viewer/jobs.html")
    german.wait_for_function(f"{SEEN} === 'visible'")


def test_who_reads_english_loads_no_german(browser: Chromium, url: str) -> None:
    page = browser.new_page(locale="en-GB")
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(f"{url}/viewer/jobs.html")
    page.wait_for_selector("nav >> text=Jobs")
    assert any(request.endswith("/i18n.js") for request in asked)
    assert not any("german" in request for request in asked)
    browser.put_away(page.context)
