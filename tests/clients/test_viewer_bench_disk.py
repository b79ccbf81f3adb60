"""The label bench saves in a folder that the browser lets it write into, and over nobody's newer
label.

The folder is one of the browser's own (the origin private file system), in the place of one that
somebody chooses: the same handles, without a dialog that no test can answer.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator
from typing import Any

import pytest
from dlo_client.labelling import PictureLabel, label_of

from tests.browser import Chromium
from tests.clients import samples
from tests.clients.browser_pages import NEEDS_BROWSER, opened
from tests.clients.fake_service import FakeService
from tests.clients.test_viewer_bench import BENCH, cables, seeing
from tests.clients.test_viewer_labels import click, png, press, probability, seen, sha256, tool

pytestmark = NEEDS_BROWSER
NAME = "left/shelf.png"
PICTURE = png(probability())
FOLDER = """
window.folder = async () => (await navigator.storage.getDirectory()).getDirectoryHandle("shelves", { create: true });
window.showDirectoryPicker = () => window.folder();
window.parentOf = async (path, create) => {
    const steps = path.split("/"), last = steps.pop();
    let folder = await window.folder();
    for (const step of steps) folder = await folder.getDirectoryHandle(step, { create });
    return { folder, last };
};
const query = FileSystemHandle.prototype.queryPermission;
const prompts = () => localStorage.getItem("prompts") === "yes";
FileSystemHandle.prototype.queryPermission = async function (how) {
    return prompts() ? "prompt" : query.call(this, how);
};
FileSystemHandle.prototype.requestPermission = async () => (localStorage.setItem("prompts", "no"), "granted");
"""
WRITE = """async ([path, data]) => {
    const { folder, last } = await parentOf(path, true);
    const file = await (await folder.getFileHandle(last, { create: true })).createWritable();
    await file.write(Uint8Array.from(atob(data), (c) => c.charCodeAt(0)));
    await file.close();
}"""
READ = """async (path) => {
    try {
        const { folder, last } = await parentOf(path, false);
        return await (await (await folder.getFileHandle(last)).getFile()).text();
    } catch (error) {
        if (error.name === "NotFoundError") return null;
        throw error;
    }
}"""


def label(count: int = 2) -> PictureLabel:
    """The first ``count`` cables of the samples, as ``dlo label`` wrote them."""
    two = label_of(samples.two_cables(), NAME, sha256(PICTURE))
    return two.model_copy(update={"instances": two.instances[:count], "crossings": []})


def write(page: Any, path: str, content: bytes) -> None:
    page.evaluate(WRITE, [path, base64.b64encode(content).decode()])


def read(page: Any, path: str) -> PictureLabel | None:
    text = page.evaluate(READ, path)
    return PictureLabel.model_validate_json(text) if text else None


@pytest.fixture
def page(browser: Chromium) -> Iterator[Any]:
    """The bench with a folder in which one picture is labelled, opened to save in it."""
    with opened(browser, seeing(), BENCH) as page:
        page.add_init_script(FOLDER)
        page.reload()
        page.wait_for_selector("body[data-ready]")
        write(page, "pictures/left/shelf.png", PICTURE)
        write(page, f"out/labels/{NAME}.json", label().model_dump_json().encode())
        write(page, "out/ledger.sqlite", b"")
        page.click("#disk")
        seen(page, NAME)
        yield page


def remove_a_cable(page: Any) -> None:
    tool(page, "delete")
    click(page, 80, 11)


def settled(page: Any) -> None:
    page.wait_for_selector("#saved >> text=Saved in the folder")


def test_a_change_is_a_draft_in_the_folder_and_confirmed_a_correction(page: Any) -> None:
    assert page.inner_text("#pictures .name") == NAME
    remove_a_cable(page)
    settled(page)
    draft = read(page, f"out/drafts/{NAME}.json")
    assert draft
    assert (len(draft.instances), draft.origin, draft.name, draft.sha256) == (
        1,
        "service",
        NAME,
        sha256(PICTURE),
    )
    page.keyboard.press("c")
    page.wait_for_selector("#pictures button.confirmed")
    settled(page)
    corrected = read(page, f"out/corrected/{NAME}.json")
    assert corrected
    assert (len(corrected.instances), corrected.origin) == (1, "corrected")
    assert read(page, f"out/drafts/{NAME}.json") is None
    assert read(page, f"out/labels/{NAME}.json") == label(), "what the service found stays"


@pytest.mark.parametrize("keeps", [True, False])
def test_what_somebody_else_saved_meanwhile_is_not_overwritten(page: Any, keeps: bool) -> None:
    theirs = label(1).model_copy(update={"origin": "corrected"})
    write(page, f"out/corrected/{NAME}.json", theirs.model_dump_json().encode())
    asked: list[str] = []

    def answer(dialog: Any) -> None:
        asked.append(dialog.message)
        (dialog.accept if keeps else dialog.dismiss)()

    page.on("dialog", answer)
    tool(page, "add")
    click(page, 17, 99)
    click(page, 147, 98)
    press(page, "Enter")
    settled(page)
    assert ["was changed by somebody else meanwhile" in text for text in asked] == [True]
    assert cables(page) == (3 if keeps else 1)
    assert read(page, f"out/corrected/{NAME}.json") == theirs
    draft = read(page, f"out/drafts/{NAME}.json")
    assert (len(draft.instances) if draft else 0) == (3 if keeps else 0)


def test_after_a_reload_somebody_allows_it_once_more(page: Any) -> None:
    remove_a_cable(page)
    settled(page)
    page.evaluate("localStorage.setItem('prompts', 'yes')")
    page.reload()
    page.wait_for_selector("body[data-ready]")
    page.wait_for_selector("#instances button")
    page.click("#undo")
    page.wait_for_selector("#saved >> text=could not be reached")
    page.wait_for_selector("#error >> text=asks again")
    assert len(read(page, f"out/drafts/{NAME}.json").instances) == 1  # type: ignore[union-attr]
    page.click("#reopen >> text=Go on saving in out")
    settled(page)
    assert len(read(page, f"out/drafts/{NAME}.json").instances) == 2  # type: ignore[union-attr]
    assert page.is_hidden("#reopen")


def test_a_label_that_cannot_be_read_is_named(page: Any) -> None:
    write(page, f"out/drafts/{NAME}.json", b"{")
    remove_a_cable(page)
    page.wait_for_selector("#error >> text=its label in the folder cannot be read")
    assert page.evaluate(READ, f"out/drafts/{NAME}.json") == "{"


def again(page: Any) -> None:
    """Opens the folder once more on an empty bench."""
    page.evaluate("window.confirm = () => true")
    page.click("#clear")
    page.wait_for_selector(".invitation", state="visible")
    page.click("#disk")


def test_a_label_of_other_bytes_is_neither_shown_nor_replaced(page: Any) -> None:
    """A picture that was exchanged since got the label of the one before it."""
    other = label().model_copy(update={"sha256": "0" * 64}).model_dump_json()
    page.evaluate("folder().then((all) => all.removeEntry('out', { recursive: true }))")
    write(page, "drafts/pictures/left/shelf.png.json", other.encode())
    again(page)
    page.wait_for_selector("#error >> text=of a picture with other bytes")
    assert page.evaluate(READ, "drafts/pictures/left/shelf.png.json") == other


def test_of_several_label_folders_somebody_chooses_one(page: Any) -> None:
    write(page, "second/ledger.sqlite", b"")
    again(page)
    page.wait_for_selector("#error >> text=several label folders in it (out/, second/)")


def test_pictures_without_labels_get_them_beside_them(page: Any) -> None:
    page.evaluate("folder().then((all) => all.removeEntry('out', { recursive: true }))")
    again(page)
    seen(page, f"pictures/{NAME}")
    remove_a_cable(page)
    settled(page)
    draft = json.loads(page.evaluate(READ, "drafts/pictures/left/shelf.png.json"))
    assert (draft["name"], len(draft["instances"])) == ("pictures/left/shelf.png", 1)


def test_where_a_browser_cannot_save_in_folders_the_page_says_so(browser: Chromium) -> None:
    with opened(browser, FakeService(), BENCH) as page:
        page.add_init_script("delete window.showDirectoryPicker")
        page.reload()
        page.wait_for_selector("body[data-ready]")
        assert page.is_visible("#no-disk")
        assert page.is_hidden("#disk")
