"""On a tablet, in German, whose words are longer: nothing on a page sticks out of the card that
holds it."""

from __future__ import annotations

import pytest

from services.page_frame import PAGES
from tests.browser import Chromium
from tests.clients.browser_pages import NEEDS_BROWSER
from tests.clients.fake_service import FakeService, served

pytestmark = NEEDS_BROWSER
STICK_OUT = """() => [...document.querySelectorAll("main *")].filter((one) => {
    const card = one.closest(".card, .toolbar");
    const box = one.getBoundingClientRect();
    return card && box.width > 1 && box.right > card.getBoundingClientRect().right + 1;
}).map((one) => one.outerHTML.slice(0, 120))"""
WRITTEN = "main :is(button, select, a.button, input[placeholder])"
CUT = """(written) => [...document.querySelectorAll(written)].filter((one) => (
    one.getBoundingClientRect().width > 1 && one.scrollWidth > one.clientWidth + 1
)).map((one) => one.outerHTML.slice(0, 120))"""


CHOSEN_CUT = """() => [...document.querySelectorAll("main select")].filter((one) => {
    const style = getComputedStyle(one), context = document.createElement("canvas").getContext("2d");
    context.font = style.font;
    const room = one.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight) - 18; // of the arrow
    return one.clientWidth > 1 && context.measureText(one.selectedOptions[0]?.text ?? "").width > room;
}).map((one) => `${one.id}: ${one.selectedOptions[0].text}`)"""


@pytest.mark.parametrize("language", ["de-DE", "en-US"])
@pytest.mark.parametrize("width", [1024, 1440])
def test_what_is_chosen_can_be_read(browser: Chromium, language: str, width: int) -> None:
    """*Section matc…* and *no other met…* on a desktop, *What is there, and what t…* on a
    tablet."""
    page = browser.new_page(
        viewport={"width": width, "height": 768}, locale=language, has_touch=width < 1100
    )
    with served(FakeService().app()) as url:
        for name in PAGES:
            page.goto(f"{url}/viewer/{name}.html")
            page.wait_for_selector("#service.good")
            assert (name, page.evaluate(CHOSEN_CUT)) == (name, [])
    browser.put_away(page.context)


@pytest.mark.parametrize("language", ["de-DE", "en-US"])
def test_nothing_sticks_out_of_its_card_on_a_tablet(browser: Chromium, language: str) -> None:
    """The button *Als nächste Version sichern* did."""
    page = browser.new_page(
        viewport={"width": 1024, "height": 768}, locale=language, has_touch=True
    )
    with served(FakeService().app()) as url:
        for name in PAGES:
            page.goto(f"{url}/viewer/{name}.html")
            page.wait_for_selector("#service.good")
            assert (name, page.evaluate(STICK_OUT), page.evaluate(CUT, WRITTEN)) == (name, [], [])
    browser.put_away(page.context)
