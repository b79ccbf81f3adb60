"""The Pictures page in a real browser, against a stand-in for the service: what is sent, listed and
drawn."""

from __future__ import annotations

import io
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from models.geometry.rle import encode
from models.instances.drawing import palette
from tests.clients import samples
from tests.clients.browser_pages import NEEDS_BROWSER, color_at, place
from tests.clients.fake_service import FakeService
from tests.clients.viewer_pictures import GRAY, analyze, jpeg, picture, show_only

pytestmark = NEEDS_BROWSER


def enter_key(page: Any) -> None:
    page.click("#open-key")
    page.fill("#key", "secret")
    page.click("#use-key")


def test_a_picture_becomes_lists(page: Any, service: FakeService) -> None:
    analyze(page)
    first, second = page.locator("#instances button").all_inner_texts()
    assert first.split() == ["1", "7.0", "×", "149", "px", "free", "–", "border", "0.95"]
    assert second.split()[-3:-1] == ["–", "hidden"]
    assert page.inner_text("#crossings button").split() == ["1", "over", "2", "0.90"]
    assert page.inner_text("#total") == "40.0 ms"
    assert [row.split() for row in page.locator("#timings li").all_inner_texts()] == [
        ["segment", "31.5", "ms"],
        ["instances", "8.3", "ms"],
        ["paths", "2.0", "ms"],
    ]
    assert page.locator("#bar span").count() == 2
    assert '"kind":"instances"' in service.requests[0]


def test_a_picture_can_be_dropped(page: Any, service: FakeService) -> None:
    script = """() => {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File(["picture"], "dropped.png"));
        document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
    }"""
    page.evaluate(script)
    page.wait_for_selector("#instances button")
    assert '@"dropped.png"' in page.text_content("#curl")
    assert len(service.requests) == 1


def test_the_upper_cable_is_drawn_through_and_the_lower_interrupted(page: Any) -> None:
    analyze(page)
    show_only(page, "centerlines")
    upper, lower = palette()[1].tolist(), palette()[2].tolist()
    assert color_at(page, 40, 60) == color_at(page, 80, 60) == upper
    assert color_at(page, 80, 30) == color_at(page, 80, 90) == lower
    beside = [color_at(page, 80, 60 - 3), color_at(page, 80, 60 + 3)]
    assert beside == [[GRAY] * 3] * 2


def test_every_layer_can_be_hidden(page: Any) -> None:
    analyze(page)
    show_only(page)
    marks = [(10, 60), (40, 60), (40, 62), (80, 10), (80, 62)]
    assert [color_at(page, *mark) for mark in marks] == [[GRAY] * 3] * len(marks)
    show_only(page, "mask")
    assert color_at(page, 40, 62) != [GRAY] * 3
    assert color_at(page, 40, 68) == [GRAY] * 3


def test_ends_have_different_markers(page: Any) -> None:
    analyze(page)
    show_only(page, "endpoints")
    one, two = palette()[1].tolist(), palette()[2].tolist()
    assert color_at(page, 10, 60) == one
    assert color_at(page, 80, 10) == two
    hidden = color_at(page, 80, 110)
    assert max(hidden) < GRAY


def test_list_and_picture_highlight_each_other(page: Any) -> None:
    analyze(page)
    show_only(page, "mask")
    page.locator("#instances button").nth(1).hover()
    page.wait_for_selector("#instances .focused")
    assert color_at(page, 40, 62) == [GRAY] * 3
    page.mouse.move(*place(page, 40, 60))
    page.wait_for_selector("#instances .focused .swatch >> text=1")
    assert color_at(page, 80, 30) == [GRAY] * 3
    page.mouse.down()
    page.mouse.up()
    page.mouse.move(0, 0)
    page.wait_for_selector("#instances [aria-pressed=true] .swatch >> text=1")


def test_a_rotated_photograph_stands_upright(page: Any) -> None:
    """The result's coordinates are those of the upright picture: here the stored top is the right
    side."""
    stored = Image.new("L", (samples.HEIGHT, samples.WIDTH), GRAY)
    stored.paste(0, (0, 0, samples.HEIGHT, samples.WIDTH // 2))
    analyze(page, jpeg(stored, orientation=6))
    show_only(page)
    assert [color_at(page, x, 20)[0] for x in (20, 140)] == [GRAY, 0]


def test_only_foreground_networks_are_offered(page: Any) -> None:
    page.wait_for_selector("#model option >> nth=1", state="attached")
    assert page.locator("#model option").all_inner_texts() == ["default", "foreground_compact 1"]


def test_the_request_is_shown_as_code(page: Any) -> None:
    page.fill("#threshold", "0.25")
    enter_key(page)
    analyze(page)
    curl, python = page.text_content("#curl"), page.text_content("#python")
    assert """'request={"kind":"instances","method":"section_matching","threshold":0.25}'""" in curl
    assert r"""-F 'image=@"it'\''s.jpg"'""" in curl
    assert "Bearer $DLO_API_KEY" in curl
    assert 'InstancesRequest(method="section_matching", threshold=0.25), "it\'s.jpg"' in python
    compile(python, "snippet", "exec")
    assert "secret" not in curl + python


def test_the_code_can_be_copied(page: Any) -> None:
    page.context.grant_permissions(["clipboard-read", "clipboard-write"])
    page.click("#code summary")
    page.click("[data-copy=python]")
    page.wait_for_function("document.querySelector('[data-copy=python]').textContent === 'Copied'")
    assert page.evaluate("navigator.clipboard.readText()") == page.text_content("#python")


def test_options_and_key_reach_the_service(page: Any, service: FakeService) -> None:
    page.fill("#threshold", "0.25")
    enter_key(page)
    page.select_option("#model", "foreground_compact")
    analyze(page)
    assert '"model":"foreground_compact","threshold":0.25' in service.requests[0]
    assert service.keys == ["Bearer secret"]


def test_a_problem_is_shown_with_its_field(page: Any, service: FakeService) -> None:
    service.refusal = samples.bad_threshold()
    page.set_input_files("#file", picture())
    page.wait_for_selector("#error:visible")
    assert "threshold must be at most 1" in page.inner_text("#error")
    service.refusal = None
    page.click("#run")
    page.wait_for_selector("#instances button")
    assert not page.is_visible("#error")


def test_text_from_the_service_is_never_html(page: Any, service: FakeService) -> None:
    service.refusal = samples.refused(422).model_copy(
        update={"detail": "<img src=x onerror=alert(1)>"}
    )
    page.set_input_files("#file", picture())
    page.wait_for_selector("#error:visible")
    assert "<img" in page.inner_text("#error")
    assert page.locator("#error img").count() == 0


def test_a_running_job_can_be_cancelled(page: Any, service: FakeService) -> None:
    service.slow = True
    page.set_input_files("#file", picture())
    page.click("#cancel")
    page.wait_for_selector("#error >> text=cancelled")
    assert service.cancelled.wait(timeout=60)


def test_a_job_that_is_cancelled_on_its_way_to_the_service_is_ended(
    page: Any, service: FakeService
) -> None:
    """Its id was not known yet: it went on at the service, and nobody knew of it."""
    service.slow, service.held = True, threading.Event()
    page.set_input_files("#file", picture())
    page.click("#cancel")
    page.wait_for_selector("#error >> text=cancelled")
    service.held.set()
    assert service.cancelled.wait(timeout=60)
    assert page.inner_text("#error strong") == "The job was cancelled"


def test_a_picture_the_browser_cannot_read_still_shows_its_lines(page: Any) -> None:
    page.set_input_files("#file", {"name": "a.tif", "mimeType": "image/tiff", "buffer": b"II*\0"})
    page.wait_for_selector("#instances button")
    show_only(page, "centerlines")
    assert color_at(page, 40, 60) == palette()[1].tolist()


UNREADABLE = {"name": "a.tif", "mimeType": "image/tiff", "buffer": b"II*\0"}


def preview_of(color: int) -> bytes:
    data = io.BytesIO()
    Image.new("L", (samples.WIDTH // 2, samples.HEIGHT // 2), color).save(data, "PNG")
    return data.getvalue()


def test_a_picture_that_only_the_service_can_read_is_shown(page: Any, service: FakeService) -> None:
    """A TIFF's lines stood on an empty canvas. The preview may be smaller than the picture."""
    service.preview = preview_of(200)
    analyze(page, UNREADABLE)
    show_only(page)
    assert (
        color_at(page, 5, 5) == color_at(page, samples.WIDTH - 5, samples.HEIGHT - 5) == [200] * 3
    )


@pytest.mark.parametrize("size", [(1300, 900), (800, 1100)], ids=["desktop", "tablet"])
def test_nothing_of_the_picture_before_stays_after_one_that_cannot_be_read(
    page: Any, service: FakeService, size: tuple[int, int]
) -> None:
    """The picture before stayed, with its cables, under the problem of the next."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
    analyze(page)
    service.refusal = samples.refused(422, code="invalid_image")
    page.set_input_files("#file", UNREADABLE)
    page.wait_for_selector("#error:not([hidden])")
    assert page.is_hidden("#canvas")
    assert page.is_visible(".invitation")
    assert page.locator("#instances button").count() == 0
    service.refusal = None
    analyze(page)
    assert not page.is_visible(".invitation")
    show_only(page)
    assert color_at(page, 5, 5) == [GRAY] * 3


def test_files_are_made_when_asked_for_and_saved_under_the_pictures_name(
    page: Any, service: FakeService
) -> None:
    """The page asked for the overlay of every picture and did not draw it: large ones took four
    times as long."""
    analyze(page)
    assert '"files":[]' in service.requests[0]
    with page.expect_download() as download:
        page.click("text=overlay.png")
    assert download.value.suggested_filename == "it's.overlay.png"
    assert Path(download.value.path()).read_bytes() == samples.OVERLAY
    assert '"files":["overlay"]' in service.requests[-1]


def test_a_refusal_has_a_title_in_the_language_of_the_page(page: Any, service: FakeService) -> None:
    """A German page showed the title as the service writes it, in English."""
    page.select_option("#language", "de")
    page.wait_for_selector("html[lang=de]")
    page.wait_for_selector("#service")
    service.refusal = samples.refused(422)
    page.set_input_files("#file", picture())
    page.wait_for_selector("#error:visible")
    assert page.inner_text("#error strong") == "Die Anfrage ist nicht gültig"
    assert page.get_attribute("#error span", "lang") == "en", "what the service writes of it"


def test_the_language_is_chosen_once(page: Any) -> None:
    page.select_option("#language", "de")
    page.wait_for_selector("nav >> text=Aufträge")
    page.click("nav >> text=Labeln")
    page.wait_for_selector("body[data-ready]")
    assert page.get_attribute("html", "lang") == "de"
    assert "anklicken" in page.inner_text("#hint")


@pytest.mark.parametrize("seed", range(3))
def test_masks_are_decoded_as_the_service_encodes_them(page: Any, seed: int) -> None:
    """A tall mask of noise has short runs, a smooth one has differences of several characters."""
    noise = np.random.default_rng(seed).random((700, 90)) < (0.5, 0.001, 0.999)[seed]
    script = """async ({ counts, rows, columns }) => {
        const { labelMap } = await import("/viewer/masks.js");
        const mask_rle = { size: [rows, columns], counts };
        const result = { width: columns, height: rows, instances: [{ id: 7, mask_rle }] };
        return [...labelMap(result).ids];
    }"""
    arguments = {"counts": encode(noise), "rows": noise.shape[0], "columns": noise.shape[1]}
    decoded = np.array(page.evaluate(script, arguments)).reshape(noise.shape)
    assert np.array_equal(decoded, 7 * noise)
