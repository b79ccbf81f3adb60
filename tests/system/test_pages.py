"""Every page of the real service in a real browser, under its own security policy."""

from __future__ import annotations

import hashlib
import io
import json
import re
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

import httpx
import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from dlo_client.contracts import MaskRLE
from dlo_client.labelling import LabelledInstance, LabelStore, PictureLabel
from dlo_client.labelling.store import Entry, corrected_file, draft_file, read_label
from PIL import Image

from models.geometry.rle import encode
from services.page_frame import PAGES
from tests.browser import NEEDS_BROWSER, Chromium
from tests.clients.browser_pages import place
from tests.clients.curve_samples import straight
from tests.clients.test_viewer_labels import seen
from tests.processes import ONE_CHILD, ROOT, running_service, wait_until

pytestmark = NEEDS_BROWSER
OURS = ["", *(f"viewer/{name}.html" for name in PAGES)]
SAMPLE = ROOT / "services" / "viewer" / "samples" / "plain.jpg"
WIDTH, HEIGHT, LINE_Y = 640, 360, 30
NO_CABLES = "#instances:empty"


@pytest.fixture(scope="module")
def labels(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("labels")


@pytest.fixture
def folder(labels: Path) -> Path:
    """A label folder of its own with one picture; its label is one straight cable."""
    folder = labels / f"monday{len(list(labels.iterdir()))}"
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[LINE_Y - 5 : LINE_Y + 5] = True
    line = [(0.0, float(LINE_Y)), (WIDTH - 1.0, float(LINE_Y))]
    cable = LabelledInstance(
        id=1,
        score=0.9,
        centerline_xy=line,
        width_px=10.0,
        length_px=639.0,
        mask_rle=MaskRLE(size=mask.shape, counts=encode(mask)),
    )
    sha256 = hashlib.sha256(SAMPLE.read_bytes()).hexdigest()
    with LabelStore(folder, write=True) as store:
        store.remember_source(str(SAMPLE.parent))
        label = PictureLabel(
            name=SAMPLE.name, sha256=sha256, width=WIDTH, height=HEIGHT, instances=[cable]
        )
        store.put(Entry(SAMPLE.name, "done", sha256=sha256, certainty=0.9), label)
    return folder


@pytest.fixture(scope="module")
def address(tmp_path_factory, labels: Path) -> Iterator[str]:
    more = ONE_CHILD | {"DLO_LABELS_DIR": str(labels)}
    with running_service(tmp_path_factory.mktemp("data"), workers=1, more=more) as address:
        yield address


@contextmanager
def opened(browser: Chromium, address: str, wrong: list[str]) -> Iterator[Any]:
    """A page in a context of its own; whatever is wrong on it is added to ``wrong``."""
    page = browser.new_page(viewport={"width": 1300, "height": 900}, locale="en-US")
    page.set_default_timeout(60_000)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "console", lambda message: wrong.append(message.text) if message.type == "error" else None
    )
    page.on(
        "response", lambda response: wrong.append(response.url) if response.status >= 400 else None
    )
    yield page
    browser.put_away(page.context)


@pytest.mark.parametrize("path", [*OURS, "docs", "redoc"])
def test_a_page_loads_all_that_it_names_and_everybody_can_use_it(
    address: str, browser: Chromium, path: str
) -> None:
    """The policy forbade the pages' `<base>`: their styles and scripts were looked for in another
    folder."""
    wrong: list[str] = []
    with opened(browser, address, wrong) as page:
        page.goto(f"{address}/{path}")
        page.wait_for_load_state("networkidle" if path in ("docs", "redoc") else "load")
        if path in OURS:
            page.wait_for_selector("#service.good")
            found = Axe().run(page).response["violations"]
            wrong += [f"{v['id']}: {node['html']}" for v in found for node in v["nodes"]]
    assert wrong == []


def test_a_sample_picture_is_found_again_after_a_reload(address: str, browser: Chromium) -> None:
    wrong: list[str] = []
    with opened(browser, address, wrong) as page:
        page.goto(address)
        page.click("#samples button")
        page.wait_for_selector("#instances button")
        count = page.locator("#instances button").count()
        page.wait_for_url("**/?job=*&picture=*")
        page.reload()
        page.wait_for_selector("#instances button")
        assert page.locator("#instances button").count() == count
        script = """() => {
            const canvas = document.querySelector("#canvas");
            const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
            return data.some((value, i) => i % 4 < 3 && value > 20);
        }"""
        assert page.evaluate(script), "the picture came back too"
        page.goto(f"{address}/viewer/jobs.html")
        page.wait_for_selector("#jobs a >> nth=0")
        assert "instances" in page.inner_text("#jobs")
    assert wrong == []


def test_a_failed_job_is_one_click_from_the_failures(address: str, browser: Chromium) -> None:
    """The link of a job that no page draws went to the API, which refuses a link without a key."""
    wrong: list[str] = []
    curve = straight().model_dump(mode="json")
    curve["covariance_m2"] = [[-1e-6, 0, 0, 0, 0, 0]] * len(curve["points_m"])
    with httpx.Client(base_url=address, timeout=60) as client:
        job = client.post("/v1/jobs", json={"kind": "merge_curves", "curves": [curve]}).json()
        wait_until(lambda: client.get(f"/v1/jobs/{job['id']}").json()["state"] == "failed")
    with opened(browser, address, wrong) as page:
        page.goto(f"{address}/viewer/jobs.html")
        link = page.wait_for_selector("#failures a")
        page.select_option("#state", "failed")
        page.wait_for_selector("#jobs:not(:has-text('instances')) >> text=merge_curves")
        assert link.evaluate("(a) => a.isConnected"), "a click that comes meanwhile is not lost"
        page.click("#failures a")
        page.wait_for_url(f"**/viewer/jobs.html?job={job['id']}")
        page.wait_for_selector("#record-problem:not([hidden])")
        assert "The input cannot be used" in page.inner_text("#record-problem")
        assert json.loads(page.text_content("#record-json"))["id"] == job["id"]
    assert wrong == []


def test_a_finished_job_becomes_a_recipe_that_is_tried(address: str, browser: Chromium) -> None:
    wrong: list[str] = []
    with opened(browser, address, wrong) as page:
        page.goto(address)
        page.click("#samples button")
        page.wait_for_selector("#instances button")
        page.click("#files >> text=Make a recipe")
        page.wait_for_selector("#source:not([hidden])")
        assert "with 1 of its pictures" in page.inner_text("#source")
        page.fill("#name", "shelf")
        late: list[Any] = []  # the versions, as they were asked for after the first
        page.route(
            "**/v1/recipes/1/versions",
            lambda route: route.continue_() if late else late.extend([route, route.fetch()]),
        )
        for version in (1, 2):
            page.click("#store")
            page.wait_for_selector(f"#chosen >> text=recipe 1, version {version}")
        page.click("#dry-run")
        # The state comes with an event, what was found with the answer after it.
        page.wait_for_selector("#outcomes >> text=/succeeded \\(\\d+ cables/")
        page.set_input_files("#pictures", SAMPLE)
        before = page.get_attribute("#outcomes a", "href")
        page.click("#run")
        page.wait_for_selector(
            f"#outcomes:not(:has([href='{before}'])) >> text=/succeeded \\(\\d+/"
        )
        page.wait_for_selector("#version option >> nth=1", state="attached")
        with page.expect_response("**/versions"):
            late[0].fulfill(response=late[1])
        page.evaluate("new Promise((resume) => setTimeout(resume, 100))")  # in which it is shown
        assert page.locator("#version option").count() == 2, "a late answer is not the newest"
        page.fill("#body", '{"request": {"kind": "instances", "threshold": 2}}')
        page.click("#store")
        page.wait_for_selector("#error >> text=request.threshold")
    assert [what for what in wrong if "422" not in what and "/v1/recipes/1" not in what] == []
    with httpx.Client(base_url=address) as client:
        assert client.delete("/v1/recipes/1").status_code == 204


def test_a_film_is_tracked(address: str, browser: Chromium, tmp_path: Path) -> None:
    wrong: list[str] = []
    with opened(browser, address, wrong) as page:
        page.goto(f"{address}/viewer/tracks.html")
        page.set_input_files("#file", [film_frame(shift) for shift in (0, 6)])
        page.click("#run:not([disabled])")
        page.wait_for_selector("#at >> text=2 / 2")
        page.wait_for_selector("#progress", state="hidden")
        assert page.locator("#cables >> text=seen").count() >= 3
        with page.expect_download() as download:
            page.click("#save")
        download.value.save_as(tmp_path / "track.jsonl")
    frames = [json.loads(line) for line in (tmp_path / "track.jsonl").read_text().splitlines()]
    assert (
        len(
            {cable["id"] for cable in frames[0]["cables"]}
            & {cable["id"] for cable in frames[1]["cables"]}
        )
        >= 3
    )
    assert wrong == []


def film_frame(shift: int) -> dict[str, Any]:
    """The sample picture as a camera sees it that has moved by so many pixels."""
    picture = Image.open(SAMPLE)
    buffer = io.BytesIO()
    picture.crop((shift, 0, picture.width - 20 + shift, picture.height)).save(buffer, "PNG")
    return {"name": f"{shift}.png", "mimeType": "image/png", "buffer": buffer.getvalue()}


def test_yolo_leaves_the_bench_with_its_pictures(
    address: str, browser: Chromium, folder: Path, tmp_path: Path
) -> None:
    wrong: list[str] = []
    with opened(browser, address, wrong) as page:
        open_folder(page, address, folder)
        other = SAMPLE.with_name("busy.jpg")
        page.set_input_files("#file", other)
        wait_until(lambda: len(re.findall(r"certainty 0\.\d\d", page.inner_text("#pictures"))) == 2)
        page.select_option("#format", "yolo")
        with page.expect_download() as download:
            page.click("#save")
        download.value.save_as(tmp_path / "yolo.zip")
    with zipfile.ZipFile(tmp_path / "yolo.zip") as archive:
        assert archive.testzip() is None
        found = {PurePosixPath(name): archive.read(name) for name in archive.namelist()}
    pictures = {path: data for path, data in found.items() if "images" in path.parts}
    assert {path.name: data for path, data in pictures.items()} == {
        p.name: p.read_bytes() for p in (SAMPLE, other)
    }
    for path in pictures:
        assert found[PurePosixPath("yolo/labels", path.parent.name, path.stem + ".txt")]
    assert wrong == []


def open_folder(page: Any, address: str, folder: Path) -> None:
    page.goto(f"{address}/viewer/label.html?folder={folder.name}")
    page.wait_for_selector("body[data-ready]")
    seen(page, SAMPLE.name)


def remove_cable(page: Any) -> None:
    page.check("[name=tool][value=delete]")
    page.mouse.click(*place(page, 300, LINE_Y))
    page.wait_for_selector(NO_CABLES, state="attached")


def test_two_people_label_one_folder(address: str, browser: Chromium, folder: Path) -> None:
    """Who saves second is asked; what is not confirmed is no correction."""
    wrong: list[str] = []
    with opened(browser, address, wrong) as one, opened(browser, address, []) as other:
        for page in (one, other):
            open_folder(page, address, folder)
        remove_cable(one)
        wait_until(draft_file(folder, SAMPLE.name).exists)
        assert not corrected_file(folder, SAMPLE.name).exists()
        one.click("#confirm")
        wait_until(corrected_file(folder, SAMPLE.name).exists)
        asked: list[str] = []
        other.on("dialog", lambda dialog: (asked.append(dialog.message), dialog.dismiss()))
        other.keyboard.press("c")
        other.wait_for_selector(NO_CABLES, state="attached")
        assert "somebody else" in asked[0]
    kept = read_label(corrected_file(folder, SAMPLE.name))
    assert (kept.origin, kept.instances) == ("corrected", [])
    assert wrong == []
