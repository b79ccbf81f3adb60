"""The Pictures page in a real browser: several pictures and what is unsure in them, two methods,
depth, addresses."""

from __future__ import annotations

import json
from typing import Any

from dlo_client.contracts import SceneStatus

from tests.clients import samples
from tests.clients.browser_pages import NEEDS_BROWSER, place
from tests.clients.fake_service import FakeService
from tests.clients.viewer_pictures import analyze, picture

pytestmark = NEEDS_BROWSER


def test_the_page_says_what_is_unsure_and_why(page: Any, service: FakeService) -> None:
    analyze(page)
    assert page.inner_text("#status") == "Sure: every score is at least 0.8"
    result = service.finished.result
    unsure = result.instances[1].model_copy(update={"score": 0.4, "reasons": ["gap", "parallel"]})
    status = SceneStatus(code="unsure", limit=0.8, reasons=["gap", "parallel"])
    changed = result.model_copy(
        update={"instances": [result.instances[0], unsure], "status": status}
    )
    service.finished = service.finished.model_copy(update={"result": changed})
    page.click("#run")
    page.wait_for_selector("#status.unsure")
    assert page.inner_text("#status") == "Unsure: a score is below 0.8 (gap, beside another)"
    first, second = page.locator("#instances .ends").all_inner_texts()
    assert first == "free – border"
    assert second == "free – hidden; gap, beside another"


def unsure_job() -> Any:
    """As the usual answer, but its second cable has a low score."""
    job = samples.instances_job()
    result = job.result
    low = result.instances[1].model_copy(update={"score": 0.4, "reasons": ["gap"]})
    status = SceneStatus(code="unsure", limit=0.8, reasons=["gap"])
    changed = result.model_copy(update={"instances": [result.instances[0], low], "status": status})
    return job.model_copy(update={"result": changed, "id": "f" * 32})


def test_several_pictures_are_reviewed_worst_first(page: Any, service: FakeService) -> None:
    service.of_picture = {"doubtful.jpg": unsure_job()}
    page.set_input_files(
        "#file", [{**picture(), "name": "sure.jpg"}, {**picture(), "name": "doubtful.jpg"}]
    )
    page.wait_for_selector("#film .mark.unsure")
    page.wait_for_selector("#film .mark.ok")
    first, second = page.locator("#film button").all_inner_texts()
    assert first.split() == ["doubtful.jpg", "unsure", "0.40"]
    assert second.split() == ["sure.jpg", "ok", "0.90"]
    page.click("#film button >> nth=0")
    assert page.locator("#instances .culprit .swatch").all_inner_texts() == ["2"]
    scale = "Number(document.querySelector('#canvas').dataset.scale)"
    fitted = page.evaluate(scale)
    page.click("#worst")
    assert page.evaluate(scale) != fitted
    assert page.locator("#instances [aria-pressed=true] .swatch").inner_text() == "2"
    page.keyboard.press("f")
    assert page.is_hidden("#worst")


def unsure_at_the_border() -> Any:
    job = samples.instances_job()
    (first, second) = job.result.instances
    line = [(1500.0, 20.0), (1580.0, 140.0)]
    low = second.model_copy(update={"score": 0.4, "reasons": ["short"], "centerline_xy": line})
    status = SceneStatus(code="unsure", limit=0.8, reasons=["short"])
    changed = job.result.model_copy(
        update={"instances": [first, low], "crossings": [], "status": status}
    )
    large = changed.model_copy(update={"width": 10 * samples.WIDTH, "height": 10 * samples.HEIGHT})
    return job.model_copy(update={"result": large})


def test_what_is_unsure_at_the_border_leaves_no_part_of_the_view_empty(
    page: Any, service: FakeService
) -> None:
    """The place was brought to the middle of the view, whose upper and right third stayed black."""
    service.next = [unsure_at_the_border()]
    analyze(page)
    page.click("#worst")
    left, top, right, bottom = page.evaluate(
        """() => {
        const canvas = document.querySelector("#canvas"), { scale, left, top } = canvas.dataset;
        const [w, h] = [WIDTH * scale, HEIGHT * scale];
        return [left, top, canvas.clientWidth - left - w, canvas.clientHeight - top - h].map(Number);
    }""".replace("WIDTH", str(10 * samples.WIDTH)).replace("HEIGHT", str(10 * samples.HEIGHT))
    )
    assert max(left, top, right, bottom) <= 0.01, "no margin on any side"
    x, y = place(page, 1540, 80)
    box = page.locator("#canvas").bounding_box()
    assert box["x"] < x < box["x"] + box["width"]
    assert box["y"] < y < box["y"] + box["height"]


PINHOLE = {"width": 160, "height": 120, "fx": 150, "fy": 150, "cx": 79.5, "cy": 59.5}


def measured_job() -> Any:
    job = samples.instances_job()
    first, second = job.result.instances
    curve = [(0.0, 0.0, 0.5), (0.1, 0.0, 0.5)]
    covariance = [(1e-8, 0, 0, 1e-8, 0, 1e-8)] * 2
    more = {
        "curve_m": curve,
        "radius_m": 0.003,
        "sigma_m": [0.0004, 0.0004],
        "covariance_m2": covariance,
    }
    changed = job.result.model_copy(update={"instances": [first.model_copy(update=more), second]})
    return job.model_copy(update={"result": changed})


def test_a_picture_is_sent_with_its_depth_and_measured(page: Any, service: FakeService) -> None:
    """The pages knew no depth; and the map of one picture must not go with another."""
    analyze(page)
    service.finished = measured_job()
    page.click("summary >> text=Depth")
    page.set_input_files(
        "#depth", {"name": "depth.png", "mimeType": "image/png", "buffer": b"depth"}
    )
    camera = json.dumps(PINHOLE).encode()
    page.set_input_files(
        "#camera", {"name": "camera.json", "mimeType": "application/json", "buffer": camera}
    )
    page.wait_for_function("document.querySelector('#curl').textContent.includes('fx')")
    assert 'depth=@"depth.png"' in page.text_content("#curl")
    assert 'depth="depth.png"' in page.text_content("#python")
    page.click("#run")
    page.wait_for_selector("#instances .ends >> text=10.0 cm, ⌀ 6.0 mm, σ 0.4 mm")
    assert service.parts == [["image"], ["image", "depth"]]
    assert json.loads(service.requests[1])["intrinsics"] == PINHOLE
    page.set_input_files("#file", {**picture(), "name": "other.jpg"})
    page.wait_for_function("document.querySelectorAll('#film .mark.ok').length === 2")
    assert service.parts[2] == ["image"]
    assert "intrinsics" not in json.loads(service.requests[2])
    page.click("#files >> text=Show in 3D")
    page.wait_for_url("**/viewer/reconstruction.html?job=*")
    page.wait_for_selector("#facts >> text=⌀ 6.00 mm, σ 0.40 mm")


def test_two_methods_stand_side_by_side(page: Any, service: FakeService) -> None:
    other = samples.instances_job()
    service.next = [other, unsure_job()]
    page.select_option("#compare", "rt_dlo")
    analyze(page)
    page.wait_for_selector("#other:visible")
    assert [json.loads(request)["method"] for request in service.requests] == [
        "section_matching",
        "rt_dlo",
    ]
    assert "2 instances" in page.inner_text("#beside")
    page.focus("#canvas")
    page.keyboard.press("+")
    scales = page.evaluate(
        "['#canvas', '#other'].map((id) => document.querySelector(id).dataset.scale)"
    )
    assert scales[0] == scales[1], "they keep the same view"


def test_an_answer_has_an_address(page: Any) -> None:
    """A reload lost it, and going back left the pages."""
    start = page.url
    analyze(page)
    page.wait_for_url(f"**/?job={samples.JOB_ID}&picture=*")
    page.reload()
    page.wait_for_selector("#instances button")
    page.go_back()
    page.wait_for_url(start)
