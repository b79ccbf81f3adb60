"""The label bench in a real browser, while something is still on its way: the database, a picture,
a click on a list."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.browser import Chromium
from tests.clients.browser_pages import NEEDS_BROWSER, opened
from tests.clients.fake_service import FakeService
from tests.clients.test_viewer_bench import BENCH, empty_bench, seeing
from tests.clients.test_viewer_labels import choose, click, png, press, probability, seen, take

pytestmark = NEEDS_BROWSER
PICTURE = png(probability())


@pytest.fixture
def service() -> FakeService:
    return seeing()


@pytest.fixture
def page(browser: Chromium, service: FakeService) -> Iterator[Any]:
    yield from empty_bench(browser, service)


def test_what_did_not_change_in_a_list_stays_there(page: Any) -> None:
    """All lists were made anew after every edit: the focus was lost, and a click in between."""
    take(page, "shelf.png", PICTURE)
    cable = page.query_selector("#instances button")
    click(page, 17, 99)
    click(page, 147, 98)
    press(page, "Enter")
    assert page.locator("#instances button").count() == 3
    assert cable.evaluate("(row) => row.isConnected")
    assert "changed" in page.inner_text("#pictures button")


HOLD_WRITES = """() => {
    const put = IDBObjectStore.prototype.put;
    IDBObjectStore.prototype.put = function (...given) {
        const hold = () => window.released || (this.count().onsuccess = hold);
        hold();
        return put.apply(this, given);
    };
    IDBTransaction.prototype.commit = () => {};
}"""


def test_a_click_is_not_kept_before_it_is(page: Any) -> None:
    """*Every step is kept* stood there while the click was on its way into the database."""
    take(page, "shelf.png", PICTURE)
    page.wait_for_selector("#saved >> text=Every step is kept")
    page.evaluate(HOLD_WRITES)
    click(page, 20, 20)
    page.wait_for_selector("#saved >> text=Keeping this step")
    page.evaluate("window.released = true")
    page.wait_for_selector("#saved >> text=Every step is kept")


HOLD_BITMAPS = """() => {
    const make = window.createImageBitmap;
    window.createImageBitmap = async (...given) => {
        while (!window.released) await new Promise((resume) => setTimeout(resume, 20));
        return make.call(window, ...given);
    };
}"""


def test_a_picture_that_is_being_opened_is_told_to_be(page: Any) -> None:
    """Its cables were listed when the service had answered, and a click found no picture."""
    page.evaluate(HOLD_BITMAPS)
    choose(page, "shelf.png", PICTURE)
    page.wait_for_selector("#instances button")
    assert page.get_attribute("#drop", "aria-busy") == "true"
    page.evaluate("window.released = true")
    seen(page, "shelf.png")


HOLD_KEPT = """
const ask = IDBObjectStore.prototype.getAll;
IDBObjectStore.prototype.getAll = function (...range) {
    const asked = ask.apply(this, range);
    const hold = () => (window.released ? null : (this.count().onsuccess = hold));
    if (this.name === "pictures") hold();
    return asked;
};"""


def test_a_picture_opened_before_the_kept_ones_are_read_stays(
    browser: Chromium, service: FakeService
) -> None:
    """What had been kept took the place of what was there by then: the picture was gone."""
    with opened(browser, service) as page:
        page.add_init_script(HOLD_KEPT)
        page.goto(page.url + BENCH)
        choose(page, "shelf.png", PICTURE)
        page.evaluate("new Promise((resume) => setTimeout(resume, 200))")  # it would be opened now
        page.evaluate("window.released = true")
        seen(page, "shelf.png")
        page.wait_for_selector("body[data-ready]")
        assert page.locator("#pictures button").count() == 1
