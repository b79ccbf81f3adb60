"""The label bench in a real browser: nothing is lost, and nothing lands under another picture."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from dlo_client.labelling import PictureLabel, label_of
from PIL import Image

from tests.browser import Chromium
from tests.clients import samples
from tests.clients.browser_pages import NEEDS_BROWSER, opened, place
from tests.clients.fake_service import FakeService
from tests.clients.test_viewer_labels import (
    bow,
    choose,
    click,
    done,
    drag,
    png,
    press,
    probability,
    saved,
    seen,
    sha256,
    take,
    tool,
)

pytestmark = NEEDS_BROWSER
BENCH = "viewer/label.html"


@pytest.fixture
def service() -> FakeService:
    return seeing()


@pytest.fixture
def page(browser: Chromium, service: FakeService) -> Iterator[Any]:
    yield from empty_bench(browser, service)


def seeing() -> FakeService:
    """A service that sees what the pictures show."""
    service = FakeService()
    service.file = png(probability())
    return service


def empty_bench(browser: Chromium, service: FakeService) -> Iterator[Any]:
    """The bench without a picture."""
    with opened(browser, service, BENCH) as page:
        page.wait_for_selector("body[data-ready]")
        yield page


def cables(page: Any) -> int:
    return page.locator("#instances button").count()


def reload(page: Any) -> None:
    """Who leaves while a step is still being kept is asked; a test waits instead."""
    page.wait_for_selector("#saved >> text=Every step is kept")
    page.reload()
    page.wait_for_selector("body[data-ready]")


def test_nothing_is_lost_when_the_page_is_left(page: Any, tmp_path: Any) -> None:
    """A reload lost every picture and every change."""
    take(page, "shelf.png", png(probability()))
    tool(page, "delete")
    click(page, 80, 11)
    tool(page, "add")
    click(page, 17, 99)
    click(page, 147, 98)
    press(page, "Enter")
    click(page, 20, 20)
    reload(page)
    assert cables(page) == 2
    click(page, 60, 20)
    press(page, "Enter")
    assert cables(page) == 3, "the click before the reload is the line's first"
    for left in (2, 1, 2):
        page.click("#undo")
        assert cables(page) == left
    assert page.is_disabled("#undo")
    page.keyboard.press("Control+Shift+z")
    page.keyboard.press("Control+y")
    assert cables(page) == 2
    reload(page)
    page.keyboard.press("Control+y")
    assert cables(page) == 3
    page.keyboard.press("Control+Enter")
    assert len(saved(page, tmp_path).instances) == 3


BRIGHTER = """([x, y, level]) => {
    const canvas = document.querySelector("#canvas"), box = canvas.getBoundingClientRect();
    const at = [x - box.left, y - box.top].map((value) => Math.floor(value * devicePixelRatio));
    return canvas.getContext("2d").getImageData(...at, 1, 1).data[0] > level;
}"""


def test_the_outline_is_seen_before_the_line_ends(page: Any) -> None:
    """Whether a cable needed one more click was seen only after it had ended, and whoever ended it
    waited."""
    take(page, "dim.png", png(probability() // 2))
    click(page, 17, 99)
    click(page, 147, 98)
    page.mouse.move(*place(page, 30, 30))
    level = 127 + 20
    page.wait_for_function(BRIGHTER, arg=[*place(page, 60, 86), level])
    press(page, "Enter")
    assert cables(page) == 3
    click(page, 20, 20)
    page.keyboard.press("Escape")
    assert cables(page) == 3


HOLD = """() => {
    const ask = IDBObjectStore.prototype.getAll;
    IDBObjectStore.prototype.getAll = function (...range) {
        const asked = ask.apply(this, range);
        const hold = () => (window.released || this.name !== "steps" ? null : (this.count().onsuccess = hold));
        hold();
        this.transaction.addEventListener("complete", () => setTimeout(() => (window.read = true)));
        return asked;
    };
}"""


def test_a_change_stays_when_the_database_answers_late(page: Any) -> None:
    """What was read of a picture took the place of what had been done meanwhile: a removed cable
    was back."""
    page.evaluate(HOLD)
    take(page, "shelf.png", png(probability()))
    tool(page, "delete")
    click(page, 80, 11)
    assert "changed" in page.inner_text("#pictures button")
    page.evaluate("window.read = false; window.released = true")
    page.wait_for_function("window.read")
    page.wait_for_selector("#saved >> text=Every step is kept")
    assert "changed" in page.inner_text("#pictures button")
    assert cables(page) == 1


def archive(files: dict[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as out:
        for name, content in files.items():
            out.writestr(name, content)
    return data.getvalue()


def label(picture: bytes, name: str, count: int) -> PictureLabel:
    """The first ``count`` cables of the samples."""
    two = label_of(samples.two_cables(), name, sha256(picture))
    return two.model_copy(
        update={"instances": two.instances[:count], "crossings": [], "origin": "corrected"}
    )


def test_labels_of_an_archive_find_their_pictures_by_bytes(page: Any, service: FakeService) -> None:
    """Two pictures of one name in two folders: corrections were filed by name, so one got those of
    the other."""
    one, other, stranger = (
        png(np.full((samples.HEIGHT, samples.WIDTH), gray, np.uint8)) for gray in (40, 80, 120)
    )
    data = archive(
        {
            "left/0001.png": one,
            "right/0001.png": other,
            "corrected/a.json": label(other, "left/0001.png", 1).model_dump_json().encode(),
            "labels/b.json": label(stranger, "right/0001.png", 2).model_dump_json().encode(),
        }
    )
    choose(page, "folder.zip", data, "application/zip")
    page.wait_for_function("document.querySelectorAll('#pictures button').length === 2")
    page.wait_for_selector("#pictures button.confirmed >> text=right/0001.png")
    page.wait_for_selector("#pictures button >> text=certainty")
    page.wait_for_selector("#notice >> text=1 labels have no picture")
    assert len(service.requests) == 1, (
        "the picture without a label of its own was sent to the service"
    )
    page.click("#pictures button.confirmed")
    page.wait_for_function("document.querySelectorAll('#instances button').length === 1")


def test_areas_connectors_and_branch_points_are_labels_too(page: Any, tmp_path: Any) -> None:
    take(page, "shelf.png", png(probability()))
    page.keyboard.press("i")
    for corner in ((5, 5), (30, 5), (30, 30)):
        click(page, *corner)
    press(page, "Enter")
    page.keyboard.press("k")
    drag(page, (100, 20), (120, 40))
    page.keyboard.press("b")
    click(page, 140, 110)
    found = saved(page, tmp_path)
    assert [[tuple(round(v) for v in at) for at in polygon] for polygon in found.ignore] == [
        [(5, 5), (30, 5), (30, 30)]
    ]
    ((left, top), *_, (right, bottom)) = (found.connectors[0][0], found.connectors[0][2])
    assert (left, top, right, bottom) == pytest.approx((100, 20, 120, 40), abs=0.5)
    assert found.branch_points[0] == pytest.approx((140, 110), abs=0.5)
    page.click("#confirm")
    saved(page, tmp_path, "coco")
    data = json.loads((tmp_path / "coco.json").read_text())
    assert [(a["category_id"], a["iscrowd"]) for a in data["annotations"]] == [
        (1, 0),
        (1, 0),
        (1, 1),
        (2, 0),
    ]
    tool(page, "delete")
    click(page, 140, 110)
    click(page, 25, 10)
    assert saved(page, tmp_path).ignore == saved(page, tmp_path).branch_points == []


def test_what_only_the_service_can_decode_is_shown(page: Any, service: FakeService) -> None:
    """A TIFF of 16 bits."""
    service.preview = png(probability())
    data = io.BytesIO()
    Image.fromarray(np.full((samples.HEIGHT, samples.WIDTH), 4000, np.uint16)).save(data, "TIFF")
    take(page, "depth.tif", data.getvalue(), "image/tiff")
    assert page.is_hidden(".invitation")
    assert page.is_hidden("#error")


def test_pictures_are_gone_through_with_the_keys_of_cvat(page: Any, tmp_path: Any) -> None:
    for gray in (0, 30, 60):
        choose(page, f"{gray}.png", png(np.maximum(probability(), gray)))
        page.wait_for_function(
            f"document.querySelectorAll('#pictures button').length === {1 + gray // 30}"
        )
    page.wait_for_function(
        "(document.querySelector('#pictures').textContent.match(/certainty/g) || []).length === 3"
    )
    page.keyboard.press("f")
    seen(page, "30.png")
    page.keyboard.press("n")
    click(page, *bow()[5])
    click(page, *bow()[50])
    page.keyboard.press("n")
    done(page)
    assert cables(page) == 3
    page.click("#instances button >> nth=2")
    page.keyboard.press("Delete")
    done(page)
    assert cables(page) == 2
    page.keyboard.press("Control+Enter")
    seen(page, "0.png")
    assert page.inner_text("#count") == "1 of 3 confirmed, 0 changed"


def test_what_the_service_was_unsure_of_is_there_to_be_labelled(
    browser: Chromium, service: FakeService
) -> None:
    service.unsure = {sha256(data): data for data in (png(probability()), png(255 - probability()))}
    with opened(browser, service, BENCH) as page:
        page.click("#unsure")
        page.wait_for_function("document.querySelectorAll('#pictures button').length === 2")
        page.wait_for_selector("#instances button")
