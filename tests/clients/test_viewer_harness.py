"""The harness page in a real browser, against a stand-in for the service."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.browser import Chromium
from tests.clients import harness_samples, samples
from tests.clients.browser_pages import NEEDS_BROWSER, color_at, opened
from tests.clients.fake_service import FakeService
from tests.clients.viewer_pictures import picture, request_in
from tests.processes import wait_until

pytestmark = NEEDS_BROWSER


@pytest.fixture
def service() -> FakeService:
    service = FakeService()
    service.finished = harness_samples.job()
    return service


@pytest.fixture
def page(browser: Chromium, service: FakeService) -> Iterator[Any]:
    with opened(browser, service, "viewer/harness.html", 1000) as page:
        yield page


def test_topology_and_action_become_lists(page: Any, service: FakeService) -> None:
    page.set_input_files("#file", picture())
    page.wait_for_selector("#actions button")
    assert page.input_value("#kind") == "plan_disentangle"
    assert '"kind":"plan_disentangle"' in service.requests[0]
    assert page.inner_text("#status") == "planned"
    assert page.locator("#sections button").count() == 3
    assert page.inner_text("#branches button").split()[:3] == ["1", "3", "sections"]
    assert page.inner_text("#crossings button").split() == ["1", "1", "over", "2", "0.88"]
    assert "1 → 0 crossings" in page.inner_text("#actions button")


def test_layers_draw_what_they_say(page: Any) -> None:
    page.set_input_files("#file", picture())
    page.wait_for_selector("#actions button")
    middle = samples.WIDTH / 2, samples.HEIGHT / 2
    assert color_at(page, *middle) == [255, 210, 63], "the branch-point"
    for layer in ("sections", "points", "action"):
        page.uncheck(f"input[name={layer}]")
    plain = color_at(page, *middle)
    assert max(plain) - min(plain) < 8, "the gray picture"
    page.check("input[name=sections]")
    assert color_at(page, middle[0] + 20, middle[1]) != plain


def test_a_picture_is_sent_with_its_depth(page: Any, service: FakeService) -> None:
    """Only the page of the pictures could; it shows which strand is on top. Another picture has
    another depth."""
    page.set_input_files("#file", picture())
    page.wait_for_selector("#actions button")
    page.set_input_files(
        "#depth", {"name": "depth.png", "mimeType": "image/png", "buffer": picture()["buffer"]}
    )
    page.wait_for_function(
        "document.querySelector('#curl').textContent.split('depth=@\"depth.png\"').length === 2"
    )
    page.click("#run")
    wait_until(lambda: service.parts[1:] == [["image", "depth"]])
    page.wait_for_selector("#actions button")
    page.set_input_files("#file", {**picture(), "name": "other.jpg"})
    page.wait_for_selector("#canvas[aria-label^='other.jpg:']")
    assert service.parts[-1] == ["image"]


def test_a_drawing_asks_for_names(page: Any, service: FakeService) -> None:
    drawing = b'{"branches": [{"name": "trunk", "a": "A", "b": "B", "length": 100}]}'
    page.set_input_files(
        "#drawing", {"name": "d.json", "mimeType": "application/json", "buffer": drawing}
    )
    page.set_input_files("#file", picture())
    page.wait_for_function("document.querySelector('#section-count').value === '3'")
    assert '"kind":"topology"' in service.requests[0]
    assert '"trunk"' in service.requests[0]


@pytest.mark.parametrize(
    ("choice", "part", "named"),
    [("", "image", False), ("photograph", "image", True), ("mask", "mask", False)],
)
def test_a_mask_is_offered_to_be_taken_as_one(
    page: Any, service: FakeService, choice: str, part: str, named: bool
) -> None:
    """A harness mask opened on this page was segmented like a photograph: four branch-points where
    there is one."""
    page.select_option("#as", choice)
    page.set_input_files("#file", picture())
    page.wait_for_selector("#actions button")
    assert service.parts[0] == [part]
    assert (f'"model":"{samples.network().name}"' in service.requests[0]) == named
    assert '"files":[]' in service.requests[0]


def test_nothing_of_the_picture_before_stays_after_one_that_cannot_be_read(
    page: Any, service: FakeService
) -> None:
    """As on the first page: the picture before stayed under the problem of the next."""
    page.set_input_files("#file", picture())
    page.wait_for_selector("#sections button")
    service.refusal = samples.refused(422, code="invalid_image")
    page.set_input_files("#file", {"name": "a.tif", "mimeType": "image/tiff", "buffer": b"II*\0"})
    page.wait_for_selector("#error:not([hidden])")
    assert page.is_hidden("#canvas")
    assert page.locator("#sections button").count() == 0


def test_the_action_is_played_over_the_picture(page: Any) -> None:
    """Somebody who wants less motion gets its end at once."""
    page.set_input_files("#file", picture())
    page.wait_for_selector("#actions button")
    page.uncheck("input[name=sections]")
    page.emulate_media(reduced_motion="reduce")
    share = "document.querySelector('#share').valueAsNumber"
    before = color_at(page, samples.WIDTH * 0.2, samples.HEIGHT * 0.93)
    page.click("#play")
    assert page.evaluate(share) == 1
    assert color_at(page, samples.WIDTH * 0.2, samples.HEIGHT * 0.93) != before, (
        "the section has come along"
    )


def test_the_request_is_shown_as_code(page: Any) -> None:
    """Only the page of the pictures had it."""
    page.select_option("#as", "mask")
    page.set_input_files("#file", picture())
    page.wait_for_selector("#actions button")
    name, call = request_in(page)
    assert name == "DisentangleRequest"
    assert [(given.arg, given.value.value) for given in call.keywords] == [("mask", "it's.jpg")]
    assert r"""-F 'mask=@"it'\''s.jpg"'""" in page.text_content("#curl")
    page.select_option("#kind", "topology")
    page.wait_for_function("document.querySelector('#recipe').textContent.includes('\"topology\"')")
    assert request_in(page)[0] == "TopologyRequest"
