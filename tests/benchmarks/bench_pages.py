"""A picture of 12 megapixels on the label bench: ``python -m tests.benchmarks.bench_pages [--repeats N]``.

In headless Chromium, against a stand-in for the service, so that only the page is measured. Milliseconds by the page's
own clock: from choosing the file until its pixels are there and a click would count; from the click that ends a line
until its outline is drawn; from a drag of an edge until that is drawn; from a frame of zooming to the next. The page
is open for three seconds before, in which a person looks for the file and the page's worker practises. Writes
``build/bench/pages.json``.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import statistics
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import sync_playwright

from tests.browser import CHROMIUM, FLAGS
from tests.clients import samples
from tests.clients.browser_pages import place
from tests.clients.fake_service import FakeService, served

SIZE = (4000, 3000)
"""Width and height."""

_ROW, _WIDTH_PX = 1500, 24
_OPEN_MS = 3000
_CLOCK = """() => {
    window.clock = {};
    const drop = document.querySelector("#drop"), confirm = document.querySelector("#confirm");
    const painted = (name) => requestAnimationFrame(() => setTimeout(() => (clock[name] ??= performance.now())));
    document.querySelector("#file").addEventListener("change", () => {
        clock = { chosen: performance.now() };
        const look = () => (Number(canvas.dataset.scale) < 1 && !confirm.disabled ? painted("opened") : requestAnimationFrame(look));
        look();
    }, { capture: true });
    const canvas = document.querySelector("#canvas");
    for (const event of ["keydown", "pointerup"]) addEventListener(event, () => (clock = { asked: performance.now() }), { capture: true });
    new MutationObserver(() => drop.getAttribute("aria-busy") === "false" && painted("done")).observe(drop, { attributes: true });
}"""  # noqa: E501


def photograph() -> bytes:
    """A JPEG with grain and one cable."""
    rng = np.random.default_rng(0)
    pixels = rng.normal(90, 6, (SIZE[1] // 4, SIZE[0] // 4, 3)).clip(0, 255).astype(np.uint8)
    image = np.asarray(Image.fromarray(pixels).resize(SIZE, Image.Resampling.BICUBIC)).copy()
    image[_ROW - _WIDTH_PX // 2 : _ROW + _WIDTH_PX // 2, 200:3800] = (200, 60, 40)
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=92)
    return buffer.getvalue()


@contextmanager
def opened() -> Iterator[Any]:
    """The label bench of a stand-in that answers no job, so that what is drawn is all there is."""
    service = FakeService()
    service.refusal = samples.refused(503)
    with sync_playwright() as playwright, served(service.app()) as url:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        page = browser.new_page(viewport={"width": 1440, "height": 900}, locale="en-US")
        page.set_default_timeout(60_000)
        page.goto(f"{url}/viewer/label.html")
        page.wait_for_selector("body[data-ready]")
        page.evaluate(_CLOCK)
        page.wait_for_timeout(_OPEN_MS)
        yield page
        browser.close()


def _took(page: Any, since: str, until: str) -> float:
    page.wait_for_function(f"clock.{until} !== undefined")
    return float(page.evaluate(f"clock.{until} - clock.{since}"))


def once(picture: bytes) -> dict[str, float]:
    """Open the picture, draw a cable, drag its edge."""
    with opened() as page:
        page.set_input_files("#file", {"name": "large.jpg", "mimeType": "image/jpeg", "buffer": picture})
        took = {"open": _took(page, "chosen", "opened")}
        for x in (1000, 3000):
            page.mouse.click(*place(page, x, _ROW))
        page.keyboard.press("Enter")
        took["click"] = _took(page, "asked", "done")
        page.check("[name=tool][value=move]")
        page.mouse.move(*place(page, 2000, _ROW + _WIDTH_PX / 2))
        page.mouse.down()
        page.mouse.move(*place(page, 2000, _ROW + _WIDTH_PX), steps=3)
        page.mouse.up()
        took["drag"] = _took(page, "asked", "done")
        took["zoom"] = page.evaluate(_ZOOM)
    return took


_ZOOM = """async () => {
    const canvas = document.querySelector("#canvas"), times = [];
    const frame = () => new Promise(requestAnimationFrame);
    for (let k = 0; k < 20; k += 1) {
        const from = performance.now();
        canvas.dispatchEvent(new WheelEvent("wheel", { deltaY: k < 10 ? -120 : 120, clientX: 500, clientY: 400, cancelable: true }));
        await frame();
        times.push(performance.now() - from);
    }
    return times.sort((a, b) => a - b)[10];
}"""  # noqa: E501


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--out", type=Path, default=Path("build/bench/pages.json"))
    asked = parser.parse_args()
    picture = photograph()
    runs = [once(picture) for _ in range(asked.repeats)]
    found: dict[str, Any] = {name: [round(run[name]) for run in runs] for name in runs[0]}
    medians = {name: statistics.median(values) for name, values in found.items()}
    result = {"ms": found, "median_ms": medians, "load": round(os.getloadavg()[0], 1)}
    print(json.dumps(result))
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.write_text(json.dumps(result))


if __name__ == "__main__":
    main()
