"""The corrector page in a real browser: what is clicked becomes a label that the SDK reads back."""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from dlo_client.labelling.formats import READERS
from PIL import Image

from models.geometry.rle import decode
from tests.browser import Chromium
from tests.clients import samples
from tests.clients.browser_pages import NEEDS_BROWSER, opened, place
from tests.clients.fake_service import FakeService

pytestmark = NEEDS_BROWSER


def probability() -> np.ndarray:
    """The two cables of the samples, and a bow that the service missed: 7 px wide, from (15, 100)
    to (150, 95)."""
    image = np.zeros((samples.HEIGHT, samples.WIDTH), np.uint8)
    image[57:64, 10:] = image[10:111, 77:84] = 255
    cv2.polylines(image, [bow().round().astype(np.int32)], False, 255, 7)
    return image


def bow() -> np.ndarray:
    x = np.linspace(15, 150, 60)
    return np.stack([x, 98 - 14 * np.sin((x - 15) / 135 * np.pi)], 1)


def png(image: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "PNG")
    return buffer.getvalue()


@pytest.fixture
def page(browser: Chromium) -> Iterator[Any]:
    """The corrector with one picture."""
    service = FakeService()
    service.file = png(probability())
    with opened(browser, service) as page:
        page.click("text=Label")
        page.wait_for_url("**/label.html")
        page.wait_for_selector("body[data-ready]")
        take(page, "shelf.png", png(probability()))
        yield page


def choose(page: Any, name: str, data: bytes, media_type: str = "image/png") -> None:
    page.set_input_files("#file", {"name": name, "mimeType": media_type, "buffer": data})


def take(page: Any, name: str, data: bytes, media_type: str = "image/png") -> None:
    """Opens a picture, and waits until it is seen with its cables."""
    choose(page, name, data, media_type)
    seen(page, name)


def seen(page: Any, name: str) -> None:
    """The picture, its cables and what lines snap to are there; each of them may be the last."""
    page.wait_for_selector("#instances button")
    page.wait_for_selector(f"#canvas[aria-label='{name}']")
    done(page)


def click(page: Any, x: float, y: float) -> None:
    """On the picture, and until what it did is done."""
    page.mouse.click(*place(page, x, y))
    done(page)


def done(page: Any) -> None:
    """The picture is open, edits that wait for an outline are done, and the tool has nothing in
    hand."""
    page.wait_for_selector("#drop:not([aria-busy=true])")


def press(page: Any, key: str) -> None:
    page.keyboard.press(key)
    done(page)


def tool(page: Any, name: str) -> None:
    page.check(f"[name=tool][value={name}]")


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def saved(page: Any, tmp_path: Path, reader: str = "json") -> Any:
    """The label of the first picture that the bench gives out, as the SDK reads it."""
    page.select_option("#format", reader)
    with page.expect_download() as download:
        page.click("#save")
    file = tmp_path / download.value.suggested_filename
    download.value.save_as(file)
    imported = READERS[reader](file)
    assert imported.problems == {}
    return imported.labels[0]


def mask(item: Any) -> np.ndarray:
    return decode(item.mask_rle.counts, item.mask_rle.size)


def test_untouched_labels_are_saved_as_they_came(page: Any, tmp_path: Path) -> None:
    label = saved(page, tmp_path)
    assert [i.mask_rle for i in label.instances] == [
        i.mask_rle for i in samples.two_cables().instances
    ]
    assert label.crossings == samples.two_cables().crossings
    assert label.origin == "service"


def test_a_label_names_the_bytes_of_its_picture(page: Any, tmp_path: Path) -> None:
    """It named the file alone: corrections landed on another picture of that name."""
    assert saved(page, tmp_path).sha256 == sha256(png(probability()))


def test_the_service_hashes_where_the_page_may_not(browser: Chromium, tmp_path: Path) -> None:
    """Over plain HTTP a browser has no `crypto.subtle`."""
    service = FakeService()
    service.file = service.preview = png(probability())
    with opened(browser, service) as page:
        page.add_init_script("Object.defineProperty(crypto, 'subtle', { value: undefined })")
        page.goto(f"{page.url}viewer/label.html")
        take(page, "shelf.png", png(probability()))
        assert saved(page, tmp_path).sha256 == sha256(png(probability()))


def test_only_what_somebody_confirmed_is_a_correction(page: Any, tmp_path: Path) -> None:
    """Pictures that nobody touched became corrections, and so did those that somebody had only
    begun to change."""
    page.click("#confirm")
    page.wait_for_selector("#pictures button >> text=confirmed")
    assert saved(page, tmp_path).origin == "corrected"
    page.click("#confirm")
    assert saved(page, tmp_path).origin == "service"
    tool(page, "delete")
    click(page, 80, 11)
    assert "changed" in page.inner_text("#pictures button")
    label = saved(page, tmp_path)
    assert (label.origin, len(label.instances)) == ("service", 1)
    assert "1 changed" in page.inner_text("#notice")
    page.click("#confirm")
    assert saved(page, tmp_path).origin == "corrected"
    page.click("#undo")
    assert saved(page, tmp_path).origin == "service"


def test_two_clicks_on_a_missed_cable_snap_to_its_centerline(page: Any, tmp_path: Path) -> None:
    click(page, 17, 99)
    click(page, 147, 98)
    press(page, "Enter")
    label = saved(page, tmp_path)
    added = label.instances[2]
    true = bow()
    away = [np.hypot(*(true - xy).T).min() for xy in added.centerline_xy]
    assert max(away) < 2
    drawn = np.zeros((samples.HEIGHT, samples.WIDTH), np.uint8)
    cv2.polylines(drawn, [true.round().astype(np.int32)], False, 1, 7)
    assert added.width_px == pytest.approx(
        drawn.sum() / np.hypot(*np.diff(true, axis=0).T).sum(), abs=0.8
    )
    both, either = (mask(added) & (drawn > 0)).sum(), (mask(added) | (drawn > 0)).sum()
    assert both / either > 0.85
    assert added.score is None
    crossing = next(c for c in label.crossings if 3 in (c.over.instance, c.under.instance))
    assert crossing.score == 0.5, "nobody has said which is on top"


def test_split_join_delete_and_undo(page: Any, tmp_path: Path) -> None:
    page.check("#probability")
    tool(page, "delete")
    click(page, 80, 11)
    assert page.locator("#instances button").count() == 1
    page.click("#undo")
    assert page.locator("#instances button").count() == 2
    tool(page, "add")
    click(page, 17, 99)
    click(page, 147, 98)
    press(page, "Enter")
    tool(page, "split")
    x, y = bow()[15]
    click(page, x, y)
    assert page.locator("#instances button").count() == 4
    tool(page, "join")
    click(page, *bow()[8])
    click(page, *bow()[25])
    label = saved(page, tmp_path)
    assert len(label.instances) == 3
    joined = np.array(label.instances[2].centerline_xy)
    assert abs(joined[:, 0].min() - 17) < 5
    assert abs(joined[:, 0].max() - 147) < 5


def test_swap_turns_the_crossing_and_its_pixels(page: Any, tmp_path: Path) -> None:
    tool(page, "swap")
    click(page, 80, 60)
    label = saved(page, tmp_path)
    crossing = label.crossings[0]
    assert (crossing.over.instance, crossing.under.instance) == (2, 1)
    upper = next(i for i in label.instances if i.id == 2)
    assert mask(upper)[60, 80]


def test_a_line_can_be_moved_and_the_map_snaps_it(page: Any, tmp_path: Path) -> None:
    tool(page, "add")
    page.uncheck("#snap")
    for x in range(20, 141, 15):
        click(page, x, 112)
    press(page, "Enter")
    tool(page, "move")
    drag(page, (80, 112), (80, 90))
    line = np.array(saved(page, tmp_path).instances[2].centerline_xy)
    assert line[np.argmin(abs(line[:, 0] - 80)), 1] < 95


def drag(
    page: Any, start: tuple[float, float], end: tuple[float, float], key: str | None = None
) -> None:
    if key:
        page.keyboard.down(key)
    page.mouse.move(*place(page, *start))
    page.mouse.down()
    page.mouse.move(*place(page, *end), steps=3)
    page.mouse.up()
    if key:
        page.keyboard.up(key)
    done(page)


def across(item: Any, x: int) -> tuple[int, int]:
    """First and last row of an instance in the column ``x``."""
    rows = np.nonzero(mask(item)[:, x])[0]
    return int(rows[0]), int(rows[-1])


def test_an_edge_is_pulled_and_with_shift_the_width(page: Any, tmp_path: Path) -> None:
    click(page, 17, 99)
    click(page, 147, 98)
    press(page, "Enter")
    top, bottom = across(saved(page, tmp_path).instances[2], 115)
    tool(page, "move")
    drag(page, (115, bottom), (115, bottom + 3))
    pulled = across(saved(page, tmp_path).instances[2], 115)
    assert pulled == (pytest.approx(top, abs=1), pytest.approx(bottom + 3, abs=1))
    drag(page, (115, pulled[1]), (115, pulled[1] + 2), "Shift")
    wider = across(saved(page, tmp_path).instances[2], 115)
    assert wider == (pytest.approx(pulled[0] - 2, abs=1), pytest.approx(pulled[1] + 2, abs=1))
    page.click("#undo")
    page.click("#undo")
    assert across(saved(page, tmp_path).instances[2], 115) == (top, bottom)


def test_with_control_a_drag_moves_the_whole_cable_and_what_follows_keeps_that(
    page: Any, tmp_path: Path
) -> None:
    """The outline went back to the picture's edges."""
    click(page, 17, 99)
    click(page, 147, 98)
    press(page, "Enter")
    columns = (60, 115)
    before = [across(saved(page, tmp_path).instances[2], x) for x in columns]
    tool(page, "move")
    middle = sum(before[1]) / 2
    drag(page, (115, middle), (115, middle - 4), "Control")
    moved = [across(saved(page, tmp_path).instances[2], x) for x in columns]
    for (top, bottom), then in zip(before, moved, strict=True):
        assert then == (pytest.approx(top - 4, abs=1), pytest.approx(bottom - 4, abs=1))
    drag(page, (115, moved[1][1]), (115, moved[1][1] + 2))
    pulled = across(saved(page, tmp_path).instances[2], 115)
    assert pulled == (pytest.approx(moved[1][0], abs=1), pytest.approx(moved[1][1] + 2, abs=1))
    page.click("#undo")
    page.click("#undo")
    assert [across(saved(page, tmp_path).instances[2], x) for x in columns] == before


def test_with_control_a_drag_of_an_edge_moves_it_all_along(page: Any, tmp_path: Path) -> None:
    """It moved the whole cable: a label that is wider on one side took two drags."""
    click(page, 17, 99)
    click(page, 147, 98)
    press(page, "Enter")
    columns = (60, 115)
    before = [across(saved(page, tmp_path).instances[2], x) for x in columns]
    tool(page, "move")
    drag(page, (115, before[1][1]), (115, before[1][1] + 4), "Control")
    moved = [across(saved(page, tmp_path).instances[2], x) for x in columns]
    for (top, bottom), then in zip(before, moved, strict=True):
        assert then == (pytest.approx(top, abs=1), pytest.approx(bottom + 4, abs=1))


def test_coco_from_the_page_is_read_like_any_other(page: Any, tmp_path: Path) -> None:
    with page.expect_download() as download:
        page.select_option("#format", "coco")
        page.click("#save")
    download.value.save_as(tmp_path / "unconfirmed.json")
    assert READERS["coco"](tmp_path / "unconfirmed.json").not_annotated == {
        "shelf.png": "nobody confirmed it"
    }
    page.click("#confirm")
    label = saved(page, tmp_path, "coco")
    assert label.sha256 == sha256(png(probability()))
    for got, true in zip(label.instances, samples.two_cables().instances, strict=True):
        assert np.array_equal(mask(got), mask(true))
    data = json.loads((tmp_path / "coco.json").read_text())
    assert [a["area"] for a in data["annotations"]] == [
        int(mask(i).sum()) for i in samples.two_cables().instances
    ]


def test_the_least_certain_picture_comes_first(page: Any) -> None:
    choose(page, "other.png", png(255 - probability()))
    page.wait_for_function("document.querySelectorAll('#pictures button').length === 2")
    page.wait_for_selector("#pictures li:nth-child(1) >> text=certainty 0.90")
