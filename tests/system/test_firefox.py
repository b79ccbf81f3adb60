"""The pages of the real service in Firefox: the main flows, with real clicks and keys."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from dlo_client.labelling.formats import READERS
from PIL import Image

from services.page_frame import PAGES
from tests.firefox import NEEDS_FIREFOX, Firefox, firefox
from tests.processes import ONE_CHILD, ROOT, running_service

pytestmark = NEEDS_FIREFOX
PICTURE = ROOT / "tests" / "samples" / "plain.jpg"
CABLES = "document.querySelectorAll('#instances button').length"
SHOWN = "document.querySelector('#canvas').getAttribute('aria-label')"
SCALE = "Number(document.querySelector('#canvas').dataset.scale)"
ANSWERED = "document.querySelector('#pictures').textContent.includes('certainty')"
KEPT = "document.querySelector('#saved').textContent.includes('Every step is kept')"
READY = "document.body?.dataset.ready === 'yes'"
# Of the bench: the picture is open, and no edit waits.
IDLE = "document.querySelector('#drop').getAttribute('aria-busy') !== 'true'"
BRIGHT = """(() => {
    const canvas = document.querySelector("#canvas");
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.some((value, i) => i % 4 < 3 && value > 60);
})()"""


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with running_service(tmp_path_factory.mktemp("data"), workers=1, more=ONE_CHILD) as address:
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


def test_an_uploaded_picture_is_there_with_its_cables_after_a_reload(
    page: Firefox, address: str
) -> None:
    page.open(address)
    page.wait_for("document.querySelector('#service.good') !== null")
    page.upload("#file", PICTURE)
    page.wait_for(f"{CABLES} >= 4 && new URLSearchParams(location.search).has('picture')")
    count = page.evaluate(CABLES)
    page.reload()
    page.wait_for(f"{CABLES} === {count}")
    page.wait_for(BRIGHT)
    page.click("#files a.button")
    page.wait_for(
        "location.pathname.endsWith('recipes.html')"
        " && document.querySelector('#source')?.hidden === false"
    )


def test_a_line_of_clicks_survives_a_reload_and_is_undone_and_saved(
    page: Firefox, address: str
) -> None:
    page.open(f"{address}/viewer/label.html")
    page.wait_for(READY)
    page.upload("#file", PICTURE)
    page.wait_for(f"{SHOWN} === 'plain.jpg' && {CABLES} >= 4 && {IDLE}")
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
    assert label.instances[-1].centerline_xy[0] == pytest.approx((376, 12), abs=3), (
        "the click before the reload"
    )
    page.click("#confirm")
    page.wait_for("document.querySelector('#pictures .confirmed') !== null")
    page.wait_for(KEPT)


@pytest.fixture
def alone(tmp_path: Path) -> Iterator[Firefox]:
    """A tab in a Firefox that keeps nothing yet; what goes wrong in it fails the test."""
    with firefox(tmp_path) as tab:
        yield tab
        assert tab.errors == []


def test_gray_of_16_bits_is_shown_by_the_service_and_drawn_in(
    alone: Firefox, address: str, tmp_path: Path
) -> None:
    """No browser decodes such a TIFF."""
    gray = np.asarray(Image.open(PICTURE).convert("L"), np.uint16)
    file = tmp_path / "gray.tif"
    Image.fromarray(16 * gray).save(file)  # 12 bits in 16: almost black as it is
    alone.open(address)
    alone.upload("#file", file)
    alone.wait_for(f"{CABLES} >= 3 && {BRIGHT}")
    alone.open(f"{address}/viewer/label.html")
    alone.wait_for(READY)
    alone.upload("#file", file)
    alone.wait_for(f"{SHOWN} === 'gray.tif' && {CABLES} >= 3 && {IDLE} && {KEPT} && {BRIGHT}")
    count = alone.evaluate(CABLES)
    alone.click_picture(376, 12)
    alone.click_picture(399, 345)
    alone.press("Enter")
    alone.wait_for(f"{CABLES} === {count + 1} && {IDLE} && {KEPT}")


def test_a_picture_of_12_megapixels_is_zoomed_and_drawn_in(
    alone: Firefox, address: str, tmp_path: Path
) -> None:
    wide, high, width = 4000, 3000, 24
    pixels = np.full((high, wide), 60, np.uint8)
    pixels[1500 - width // 2 : 1500 + width // 2, 200:3800] = 220
    file = tmp_path / "large.png"
    Image.fromarray(pixels).save(file, compress_level=1)
    alone.open(f"{address}/viewer/label.html")
    alone.wait_for(READY)
    alone.upload("#file", file)
    alone.wait_for(
        f"{SHOWN} === 'large.png' && 0 < {SCALE} && {SCALE} < 0.5 && {ANSWERED} && {IDLE}"
    )
    count = alone.evaluate(CABLES)
    fitted = alone.evaluate(SCALE)
    alone.evaluate("document.querySelector('#canvas').focus()")
    alone.press("1")
    alone.wait_for(f"{SCALE} > 2 * {fitted}")
    alone.press("0")
    alone.wait_for(f"Math.abs({SCALE} - {fitted}) < 0.01")
    alone.click_picture(1000, 1500)
    alone.click_picture(3000, 1502)
    alone.press("Enter")
    alone.wait_for(f"{CABLES} === {count + 1} && {IDLE} && {KEPT}")
    alone.reload()
    alone.wait_for(f"{READY} && {CABLES} === {count + 1}")
    alone.click("#save")
    cable = read(alone.downloaded("labels.jsonl")).instances[-1]
    assert cable.width_px == pytest.approx(width, rel=0.15)
    assert max(abs(y - 1500) for _, y in cable.centerline_xy) < 4
    assert cable.mask_rle.size == (high, wide)


def test_the_bench_says_that_firefox_does_not_save_in_folders(page: Firefox, address: str) -> None:
    page.open(f"{address}/viewer/label.html")
    page.wait_for(READY)
    assert page.evaluate("document.querySelector('#no-disk').checkVisibility()")
    assert not page.evaluate("document.querySelector('#disk').checkVisibility()")


def test_a_crash_of_the_browser_loses_nothing(address: str, tmp_path: Path) -> None:
    """Killed as soon as the page says that every step is kept."""
    with firefox(tmp_path) as page:
        page.open(f"{address}/viewer/label.html")
        page.wait_for(READY)
        page.upload("#file", PICTURE)
        page.wait_for(f"{SHOWN} === 'plain.jpg' && {CABLES} >= 4 && {IDLE} && {KEPT}")
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
