"""The page of the tracks in a real browser, against a stand-in for the service."""

from __future__ import annotations

from pathlib import Path

from models.instances.drawing import palette
from tests.browser import Chromium
from tests.clients.browser_pages import NEEDS_BROWSER, color_at, opened
from tests.clients.fake_service import FakeService
from tests.clients.viewer_pictures import picture

pytestmark = NEEDS_BROWSER


def test_pictures_become_a_film_with_ids(browser: Chromium, tmp_path: Path) -> None:
    """In the order of the numbers in their names; the film that is saved can be opened again."""
    service = FakeService()
    with opened(browser, service, "viewer/tracks.html") as page:
        page.set_input_files("#file", [{**picture(), "name": f"{k}.jpg"} for k in (10, 9, 1)])
        page.wait_for_function("document.querySelector('#at').value === '1 / 3'")
        page.click("#run")
        page.wait_for_function("document.querySelector('#at').value === '3 / 3'")
        assert service.requests == ["0", "0.2", "0.4"]
        first, second = page.locator("#cables button").all_inner_texts()
        assert (first.split()[:2], second.split()[:3]) == (
            ["1", "seen"],
            ["2", "partly", "covered"],
        )
        assert color_at(page, 40, 60) == palette()[1].tolist()
        with page.expect_download() as download:
            page.click("#save")
        download.value.save_as(tmp_path / "track.jsonl")
        page.reload()
        page.set_input_files("#track", tmp_path / "track.jsonl")
        page.wait_for_function("document.querySelector('#at').value === '1 / 3'")
        assert page.locator("#cables button").count() == 2


def test_a_film_that_cannot_be_read_is_not_run(browser: Chromium) -> None:
    """The button was there before the film had frames: none were sent."""
    with opened(browser, FakeService(), "viewer/tracks.html") as page:
        film = {"name": "a.mp4", "mimeType": "video/mp4", "buffer": b"no video"}
        page.set_input_files("#file", film)
        page.wait_for_selector("#error >> text=this video cannot be read")
        assert page.is_disabled("#run")


def test_a_sample_is_a_film(browser: Chromium) -> None:
    """Whoever had no video at hand could not try the page."""
    service = FakeService()
    with opened(browser, service, "viewer/tracks.html") as page:
        page.click("#samples button")
        page.wait_for_function("document.querySelector('#at').value === '1 / 10'")
        page.click("#run")
        page.wait_for_function("document.querySelector('#at').value === '10 / 10'")
        assert len(service.requests) == 10


HELD_VIDEO = """() => {
    const make = document.createElement.bind(document);
    document.createElement = (name) => {
        const made = make(name);
        if (name === "video") Object.defineProperty(window.video = made, "src", { set() {} });
        return made;
    };
}"""
"""No video is read before an event is sent to ``window.video``."""


def test_the_film_chosen_last_is_the_one_shown(browser: Chromium) -> None:
    """What became of a film chosen before it took its place, or its problem did."""
    film = {"name": "a.mp4", "mimeType": "video/mp4", "buffer": b"slow"}
    with opened(browser, FakeService(), "viewer/tracks.html") as page:
        page.evaluate(HELD_VIDEO)
        page.set_input_files("#file", film)
        page.wait_for_function("window.video !== undefined")
        page.set_input_files("#file", [{**picture(), "name": f"{k}.jpg"} for k in (1, 2)])
        page.wait_for_function("document.querySelector('#at').value === '1 / 2'")
        page.evaluate("window.video.dispatchEvent(new Event('error'))")
        page.evaluate("() => new Promise((resolve) => setTimeout(resolve, 0))")
        assert page.is_hidden("#error")
        page.click("#run")
        page.wait_for_function("document.querySelector('#at').value === '2 / 2'")


def test_a_film_after_a_cancelled_run_reports_its_problem(browser: Chromium) -> None:
    film = {"name": "a.mp4", "mimeType": "video/mp4", "buffer": b"no video"}
    with opened(browser, FakeService(), "viewer/tracks.html") as page:
        page.set_input_files("#file", {**picture(), "name": "1.jpg"})
        page.wait_for_function("document.querySelector('#at').value === '1 / 1'")
        page.click("#run")
        page.evaluate("document.querySelector('#cancel').click()")
        page.set_input_files("#file", film)
        page.wait_for_selector("#error >> text=this video cannot be read")
