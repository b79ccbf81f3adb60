"""The label bench in a real browser: what large pictures would make slow, and what is kept in the
browser."""

from __future__ import annotations

import base64
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.browser import Chromium
from tests.clients import samples
from tests.clients.browser_pages import NEEDS_BROWSER, opened, place
from tests.clients.fake_service import FakeService
from tests.clients.test_viewer_bench import cables, empty_bench, label, reload, seeing
from tests.clients.test_viewer_labels import (
    choose,
    click,
    done,
    png,
    press,
    probability,
    saved,
    seen,
    take,
    tool,
)

pytestmark = NEEDS_BROWSER


@pytest.fixture
def service() -> FakeService:
    return seeing()


@pytest.fixture
def page(browser: Chromium, service: FakeService) -> Iterator[Any]:
    yield from empty_bench(browser, service)


def test_a_picture_of_12_megapixels_is_zoomed_and_drawn_in(
    page: Any, service: FakeService, tmp_path: Any
) -> None:
    """A large picture was shown 1280 px wide; its labels are in its own pixels."""
    wide, high, width = 4000, 3000, 24
    pixels = np.full((high, wide), 60, np.uint8)
    pixels[1500 - width // 2 : 1500 + width // 2, 200:3800] = 220
    service.refusal = samples.refused(503)  # what a person draws does not wait for the service
    choose(page, "large.png", png(pixels))
    page.wait_for_function("Number(document.querySelector('#canvas').dataset.scale) < 0.5")
    page.wait_for_selector("#confirm:not([disabled])")
    done(page)
    scale = "Number(document.querySelector('#canvas').dataset.scale)"
    fitted = page.evaluate(scale)
    page.mouse.move(*place(page, 1000, 1500))
    for _ in range(6):
        page.mouse.wheel(0, -300)
    page.wait_for_function(f"{scale} > {4 * fitted}")
    click(page, 1000, 1500)
    page.keyboard.press("0")
    page.focus("#canvas")
    page.keyboard.press("0")
    assert page.evaluate(scale) == pytest.approx(fitted, rel=0.01)
    click(page, 3000, 1502)
    press(page, "Enter")
    (cable,) = saved(page, tmp_path).instances
    assert cable.width_px == pytest.approx(width, rel=0.15)
    assert max(abs(y - 1500) for _, y in cable.centerline_xy) < 4
    assert cable.mask_rle.size == (high, wide)


LIT = """([x, y]) => {
    const canvas = document.querySelector("#canvas"), box = canvas.getBoundingClientRect();
    const at = [x - box.left, y - box.top].map((value) => Math.floor(value * devicePixelRatio));
    return canvas.getContext("2d").getImageData(...at, 1, 1).data.slice(0, 3).some((value) => value > 10);
}"""
ASKED = """() => {
    window.asked = [];
    const ask = Worker.prototype.postMessage;
    Worker.prototype.postMessage = function (message, ...more) {
        asked.push(message.call);
        return ask.call(this, message, ...more);
    };
}"""
MASKS_ASKED = "asked.filter((call) => call === 'masks').length"


def test_masks_are_drawn_anew_only_where_one_is_another(page: Any) -> None:
    """Every edit decoded and colored all masks of the picture, in the page's own thread."""
    page.evaluate(ASKED)
    take(page, "dark.png", png(np.zeros((samples.HEIGHT, samples.WIDTH), np.uint8)))
    one, other = place(page, 40, 62), place(page, 82, 30)
    page.wait_for_function(LIT, arg=one)
    before = page.evaluate(MASKS_ASKED)
    for at in ((17, 99), (147, 98)):
        click(page, *at)
    press(page, "Enter")
    assert cables(page) == 3
    assert page.evaluate(MASKS_ASKED) == before
    tool(page, "delete")
    click(page, 80, 11)
    page.wait_for_function(f"(at) => !({LIT})(at)", arg=other)
    assert page.evaluate(MASKS_ASKED) == before + 1
    assert page.evaluate(LIT, one), "the other cable's mask stays"


def test_a_picture_is_opened_once(page: Any) -> None:
    """When the service had answered its pixels were read again, and the first click waited for
    that."""
    page.evaluate(ASKED)
    take(page, "shelf.png", png(probability()))
    click(page, 20, 20)
    calls = page.evaluate("asked")
    assert (calls.count("open"), calls.count("probability")) == (1, 1)


BYTES_KEPT = """() => {
    window.kept = 0;
    const put = IDBObjectStore.prototype.put;
    IDBObjectStore.prototype.put = function (value, ...more) {
        const all = value instanceof Blob ? [value] : Object.values(value);
        kept += all.filter((one) => one instanceof Blob).length;
        return put.call(this, value, ...more);
    };
}"""


def test_a_click_does_not_keep_the_pictures_bytes_again(page: Any) -> None:
    """Every click and every step wrote the whole picture and its probability into the database."""
    page.evaluate(BYTES_KEPT)
    take(page, "shelf.png", png(probability()))
    page.wait_for_selector("#saved >> text=Every step is kept")
    assert page.evaluate("kept") == 2
    for at in ((17, 99), (147, 98)):
        click(page, *at)
    press(page, "Enter")
    reload(page)
    assert cables(page) == 3
    page.evaluate(BYTES_KEPT)
    click(page, 20, 20)
    page.wait_for_selector("#saved >> text=Every step is kept")
    assert page.evaluate("kept") == 0


KEPT_BY_VERSION_1 = """async ([bytes, label]) => {
    const file = new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], "old.png", { type: "image/png" });
    const { name, sha256, width, height } = label;
    const record = { key: `:${sha256}`, order: 1, name, sha256, file, width, height, mask: file,
        at: 0, confirmed: false, certainty: 0.5, clicks: [], seen: true };
    await new Promise((resolve, reject) => {
        const request = indexedDB.open("dlo-label-bench", 1);
        request.onupgradeneeded = () => {
            request.result.createObjectStore("pictures", { keyPath: "key" });
            request.result.createObjectStore("steps");
        };
        request.onsuccess = () => {
            const open = request.result.transaction(["pictures", "steps"], "readwrite");
            open.objectStore("pictures").put(record);
            open.objectStore("steps").put(label, [record.key, 0]);
            open.oncomplete = () => resolve(request.result.close());
            open.onerror = reject;
        };
    });
}"""


def test_what_an_earlier_version_kept_is_still_there(
    browser: Chromium, service: FakeService
) -> None:
    data = png(probability())
    kept = label(data, "old.png", 2).model_dump(mode="json")
    with opened(browser, service) as page:
        page.evaluate(KEPT_BY_VERSION_1, [base64.b64encode(data).decode(), kept])
        page.click("text=Label")
        page.wait_for_selector("body[data-ready]")
        seen(page, "old.png")
        assert cables(page) == 2
        page.wait_for_function(LIT, arg=place(page, 40, 60))
        assert service.requests == [], "its probability was kept, too"
        for _ in range(2):
            click(page, 20, 20)
            reload(page)
            assert cables(page) == 2
            page.wait_for_function(LIT, arg=place(page, 40, 60))


SEARCHED = """async () => {
    const { cheapest, searchable } = await import("/viewer/search.js");
    const { prepare } = await import("/viewer/livewire.js");
    const [width, height, row] = [400, 400, 200];
    const p = new Float32Array(width * height).map((_, i) => Number(Math.abs(Math.floor(i / width) - row) < 2));
    const planes = [0, 1, 2].map(() => p.map((value) => 100 * value));
    const map = searchable({ ...prepare(p, width, height), planes }, [[50, row], [350, row]]);
    const path = cheapest(map, [50, row], [350, row]);
    return [path.every(([, y]) => y === row), path.length, map.prices.filter(Boolean).length];
}"""


def test_a_search_keeps_to_the_cable(page: Any) -> None:
    """It went to all that was nearer than the goal, most of a large picture: half of the time of a
    click."""
    straight, length, priced = page.evaluate(SEARCHED)
    assert (straight, length) == (True, 301)
    assert priced < 3000


STRIPS = """async () => {
    const { paint, straightened } = await import("/viewer/strip.js");
    const [width, height] = [60, 40];
    const bytes = new Uint8ClampedArray(4 * width * height).map((_, i) => (37 * i + (i >> 5)) % 256);
    const p = new Float32Array(width * height).map((_, i) => (i % 7) / 7);
    const planes = paint(bytes, width, height);
    const line = Array.from({ length: 20 }, (_, i) => [3 * i - 2.3, 5 + 1.7 * i]);
    const coarse = { width, height, sx: 1, sy: 1, p };
    const small = straightened({ width, height, planes, p }, line, 6, 0.5);
    const large = straightened({ width, height, bytes, coarse }, line, 6, 0.5);
    const off = (a, b) => Math.max(...a.map((value, i) => Math.abs(value - b[i])));
    const at = small.m * 4 + small.r;
    const [x, y] = line[4].map(Math.floor);
    return [off(small.p, large.p), ...small.colors.map((plane, c) => off(plane, large.colors[c])), small.colors[0][at],
        Math.min(...[0, 1, width, width + 1].map((k) => planes[0][y * width + x + k])),
        Math.max(...[0, 1, width, width + 1].map((k) => planes[0][y * width + x + k]))];
}"""


def test_a_large_picture_is_read_as_a_small_one(page: Any) -> None:
    """Its bytes were read by an interpolation of their own."""
    *off, value, least, most = page.evaluate(STRIPS)
    assert max(off) < 1e-3
    assert least <= value <= most


PULLED = """async () => {
    const { outlined } = await import("/viewer/outline.js");
    const { prepare } = await import("/viewer/livewire.js");
    const { paint } = await import("/viewer/strip.js");
    const [width, height] = [160, 120];
    const row = (i) => Math.floor(i / width);
    const on = Float32Array.from({ length: width * height }, (_, i) => Number(Math.abs(row(i) - 60) < 5));
    const tones = (i) => [40 + 150 * on[i], 60 + (i * 7919) % 13, 200 - 90 * on[i], 255];
    const bytes = Uint8ClampedArray.from({ length: 4 * width * height }, (_, i) => tones(i >> 2)[i & 3]);
    const same = { inside: (at) => at, outside: (line) => line, sx: 1, sy: 1 };
    const coarse = { ...prepare(on, width, height), planes: paint(bytes, width, height), ...same };
    const view = () => ({ width, height, bytes, coarse });
    const clicks = [[20, 60], [140, 60]];
    const used = view();
    const without = outlined(used, clicks);
    return [65.6, 69].map((y) => [{ at: [80, y], side: 1 }]).map((pulls) =>
        [outlined(used, clicks, pulls), outlined(view(), clicks, pulls), without]);
}"""


def test_a_pull_means_the_same_whatever_was_outlined_before(page: Any) -> None:
    """In a large picture what an outline has learned of the colors is kept for the small pulls that
    follow."""
    for kept, anew, without in page.evaluate(PULLED):
        assert kept == anew
        assert max(kept["high"]) > max(without["high"]) + 0.2
