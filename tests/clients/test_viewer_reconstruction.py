"""The 3D page in a real browser, against a stand-in for the service."""

from __future__ import annotations

import ast
import io
import json
from collections.abc import Iterator
from typing import Any

import pytest
from PIL import Image

from tests.browser import Chromium
from tests.clients import curve_samples, samples
from tests.clients.browser_pages import NEEDS_BROWSER, opened
from tests.clients.fake_service import FakeService
from tests.clients.viewer_pictures import request_in

pytestmark = NEEDS_BROWSER


def png(color: tuple[int, int, int] = (10, 200, 30)) -> bytes:
    data = io.BytesIO()
    Image.new("RGB", (64, 48), color).save(data, "PNG")
    return data.getvalue()


@pytest.fixture
def service() -> FakeService:
    service = FakeService()
    service.finished = curve_samples.job()
    service.file = png()
    return service


@pytest.fixture
def page(browser: Chromium, service: FakeService) -> Iterator[Any]:
    with opened(browser, service, "viewer/reconstruction.html", 1000) as page:
        yield page


def send(page: Any, cameras: Any) -> None:
    pictures = [{"name": f"{k}.png", "mimeType": "image/png", "buffer": png()} for k in range(3)]
    page.set_input_files("#files", pictures)
    data = json.dumps(cameras).encode()
    page.set_input_files(
        "#cameras", {"name": "cameras.json", "mimeType": "application/json", "buffer": data}
    )


def cameras() -> list[dict[str, Any]]:
    intrinsics = curve_samples.INTRINSICS.model_dump()
    return [
        {"intrinsics": intrinsics, "T_world_camera": curve_samples.pose(x)}
        for x in (-0.05, 0.0, 0.05)
    ]


def ink(page: Any, x: int, y: int, reach: int = 3) -> set[tuple[int, int, int]]:
    """The opaque colors around a CSS pixel of the canvas."""
    script = """([x, y, reach]) => {
        const canvas = document.querySelector("#space");
        const data = canvas.getContext("2d").getImageData(x - reach, y - reach, 2 * reach + 1, 2 * reach + 1).data;
        return [...Array(data.length / 4).keys()].filter((i) => data[4 * i + 3] === 255).map((i) => [...data.slice(4 * i, 4 * i + 3)]);
    }"""  # noqa: E501
    return {tuple(color) for color in page.evaluate(script, [x, y, reach])}


def size(page: Any) -> tuple[float, float]:
    box = page.locator("#space").bounding_box()
    return box["width"], box["height"]


def test_pictures_and_cameras_become_a_curve(page: Any, service: FakeService) -> None:
    assert page.is_disabled("#run")
    send(page, cameras())
    page.click("#run")
    page.wait_for_selector("#facts dd")
    request = json.loads(service.requests[0])
    assert request["kind"] == "reconstruct"
    name, call = request_in(page)
    assert name == "ReconstructRequest"
    assert ast.literal_eval(call.args[1]) == ["0.png", "1.png", "2.png"]
    assert page.text_content("#curl").count("-F 'image=@") == 3
    assert [view["T_world_camera"][0][3] for view in request["views"]] == [-0.05, 0.0, 0.05]
    facts = dict(
        zip(page.locator("dt").all_inner_texts(), page.locator("dd").all_inner_texts(), strict=True)
    )
    assert facts["length"] == "200.0 mm"
    assert facts["radius"] == "2.00 mm"
    assert facts["reprojection"] == "0.25 px"
    assert facts["ends"] == "border, free"
    assert facts["then expected"] == "0.40 mm (60 % less)"
    assert page.locator("#warnings li").all_inner_texts() == ["two views only"]


def test_a_finished_job_can_be_opened_by_its_address(page: Any) -> None:
    page.goto(f"{page.url}?job={samples.JOB_ID}")
    page.wait_for_selector("#views img")
    captions = page.locator("#views p:not(.reason)").all_inner_texts()
    assert captions == ["left: 0.25 px", "middle: 0.25 px", "right: dropped"]
    assert page.locator("#views .dropped .reason").inner_text() == "the DLO was not <b>found</b>"
    page.wait_for_function(
        "[...document.querySelectorAll('#views img')].every((i) => i.naturalWidth === 64)"
    )


def test_the_curve_and_its_uncertainty_are_where_they_should_be(page: Any) -> None:
    """From above the cable runs up the middle of the scene; seen from the side along it stands as
    one ellipse."""
    page.goto(f"{page.url}?job={samples.JOB_ID}")
    page.wait_for_selector("#facts dd")
    for name in ("cameras", "next", "uncertainty"):
        page.set_checked(f"input[name={name}]", False)
    page.click("#top")
    width, height = size(page)
    middle = (int(width / 2), int(height / 2))
    curve = {(224, 168, 0)}
    assert ink(page, *middle) == curve
    assert ink(page, middle[0], middle[1] - 40) == curve
    assert ink(page, middle[0] + 40, middle[1]) == set()
    page.set_checked("input[name=uncertainty]", True)
    page.select_option("#enlarged", "10")
    page.click("#side")
    script = """() => {
        const canvas = document.querySelector("#space"), context = canvas.getContext("2d");
        const {data} = context.getImageData(0, 0, canvas.width, canvas.height);
        const on = [...Array(data.length / 4).keys()].filter((i) => data[4 * i + 3] > 128 && data[4 * i] > 200);
        const x = on.map((i) => i % canvas.width), y = on.map((i) => Math.floor(i / canvas.width));
        const span = (v) => v.reduce((a, b) => Math.max(a, b)) - v.reduce((a, b) => Math.min(a, b));
        return [span(x), span(y)];
    }"""
    across, upward = page.evaluate(script)
    assert upward / across == pytest.approx(5, rel=0.2), "1 mm upward, 0.2 mm sideways"


def test_it_turns_with_mouse_and_keys(page: Any) -> None:
    page.goto(f"{page.url}?job={samples.JOB_ID}")
    page.wait_for_selector("#facts dd")
    # Filled lists move the canvas, which is drawn anew in the frame after.
    page.evaluate(
        "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )
    picture = "document.querySelector('#space').toDataURL()"
    before = page.evaluate(picture)
    page.focus("#space")
    page.keyboard.press("ArrowLeft")
    turned = page.evaluate(picture)
    assert turned != before
    page.keyboard.press("ArrowRight")
    assert page.evaluate(picture) == before
    box = page.locator("#space").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 360, box["y"] + 230)
    page.mouse.up()
    assert page.evaluate(picture) != before


def test_a_refusal_names_the_field(page: Any, service: FakeService) -> None:
    service.refusal = samples.refused(
        422, errors=[{"field": "views.1.T_world_camera", "message": "is no rotation"}]
    )
    send(page, cameras())
    page.click("#run")
    page.wait_for_selector("#error:visible")
    assert "views.1.T_world_camera is no rotation" in page.inner_text("#error")


@pytest.mark.parametrize("text", ["{", "3", '{"a": 1}'])
def test_cameras_that_are_none(page: Any, text: str) -> None:
    page.set_input_files(
        "#cameras", {"name": "c.json", "mimeType": "application/json", "buffer": text.encode()}
    )
    page.wait_for_selector("#error:visible")
    assert "c.json" in page.inner_text("#error")
    assert page.is_disabled("#run")


def test_the_main_page_leads_here(page: Any) -> None:
    page.click("text=Pictures >> nth=0")
    page.wait_for_selector("#instance-count", state="attached")
    page.click("header >> text=3D")
    page.wait_for_selector("#space")
