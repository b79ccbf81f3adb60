"""The pages of the real service in Firefox: the main flows, with real clicks and keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from dlo_client.labelling.formats import READERS

from services.page_frame import PAGES
from tests.firefox import NEEDS_FIREFOX, Firefox, firefox
from tests.processes import ROOT, running_service

pytestmark = NEEDS_FIREFOX
PICTURE = ROOT / "tests" / "samples" / "plain.jpg"
CABLES = "document.querySelectorAll('#instances button').length"
KEPT = "document.querySelector('#saved').textContent.includes('Every step is kept')"
READY = "document.body?.dataset.ready === 'yes'"
IDLE = "document.querySelector('#drop').getAttribute('aria-busy') !== 'true'"
BRIGHT = """(() => {
    const canvas = document.querySelector("#canvas");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.some((value, i) => i % 4 < 3 && value > 60);
})()"""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with running_service(tmp_path_factory.mktemp("data"), workers=1) as address:
        yield address


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Firefox]:
    with firefox(tmp_path_factory.mktemp("firefox")) as tab:
        yield tab


@pytest.fixture
def page(tab: Firefox) -> Iterator[Firefox]:
    """The tab; what goes wrong in it meanwhile fails the test."""
    tab.errors.clear()
    yield tab
    assert tab.errors == []


def test_every_page_loads_without_an_error(page: Firefox, address: str) -> None:
    for name in PAGES:
        page.open(f"{address}/viewer/{name}.html")
        page.wait_for("document.querySelector('#service.good') !== null")


def test_an_uploaded_picture_is_there_with_its_cables_after_a_reload(page: Firefox, address: str) -> None:
    page.open(address)
    page.wait_for("document.querySelector('#service.good') !== null")
    page.upload("#file", PICTURE)
    page.wait_for(f"{CABLES} >= 4 && new URLSearchParams(location.search).has('picture')")
    count = page.evaluate(CABLES)
    page.reload()
    page.wait_for(f"{CABLES} === {count}")
    page.wait_for(BRIGHT)
    page.click("#files a.button")
    page.wait_for("location.pathname.endsWith('recipes.html') && !document.querySelector('#source')?.hidden")


def test_a_line_of_clicks_survives_a_reload_and_is_undone_and_saved(page: Firefox, address: str) -> None:
    page.open(f"{address}/viewer/label.html")
    page.wait_for(READY)
    page.upload("#file", PICTURE)
    page.wait_for(f"{CABLES} >= 4")
    count = page.evaluate(CABLES)
    page.click_picture(376, 12)
    page.wait_for(KEPT)
    page.reload()
    page.wait_for(f"{READY} && {CABLES} === {count}")
    page.click_picture(399, 345)
    page.press("Enter")
    page.wait_for(f"{CABLES} === {count + 1} && {IDLE}")
    for keys, left in (("Control+z", count), ("Control+Shift+z", count + 1)):
        page.press(keys)
        page.wait_for(f"{CABLES} === {left}")
    page.wait_for(KEPT)
    page.click("#save")
    label = read(page.downloaded("labels.jsonl"))
    assert len(label.instances) == count + 1
    assert label.instances[-1].centerline_xy[0] == pytest.approx((376, 12), abs=3), "the click before the reload"
    page.click("#confirm")
    page.wait_for("document.querySelector('#pictures .confirmed') !== null")
    page.wait_for(KEPT)


def test_a_crash_of_the_browser_loses_nothing(address: str, tmp_path: Path) -> None:
    """Killed as soon as the page says that every step is kept."""
    with firefox(tmp_path) as page:
        page.open(f"{address}/viewer/label.html")
        page.wait_for(READY)
        page.upload("#file", PICTURE)
        page.wait_for(f"{CABLES} >= 4 && {IDLE} && {KEPT}")  # the list is made anew meanwhile, and a click on it lost
        count = page.evaluate(CABLES)
        page.click("#instances button")
        page.wait_for("document.querySelector('#instances [aria-pressed=true]') !== null")
        page.press("Delete")
        page.wait_for(f"{CABLES} === {count - 1} && {KEPT}")
        page.crash()
    with firefox(tmp_path) as page:
        page.open(f"{address}/viewer/label.html")
        page.wait_for(f"{READY} && {CABLES} === {count - 1}")
        page.wait_for(BRIGHT)
        page.press("Control+z")
        page.wait_for(f"{CABLES} === {count}")
        assert page.errors == []


def read(file: Path):
    """The one label of the file."""
    imported = READERS["json"](file)
    assert imported.problems == {}
    (label,) = imported.labels
    return label
