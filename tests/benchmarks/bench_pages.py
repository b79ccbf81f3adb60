"""A picture of 12 megapixels on the label bench: ``python -m tests.benchmarks.bench_pages
[--repeats N]``.

In headless Chromium, against a stand-in for the service, so that only the page is measured; it
answers with twelve cables and their probability, and the person draws one more. Milliseconds by the
page's own clock: from choosing the file until its pixels are there and a click would count; from
the key that ends a line until its outline is drawn; from a drag of an edge until that is drawn;
from a frame of zooming to the next. The page is open for three seconds before, in which a person
looks for the file and the page's worker practises. Writes ``build/bench/pages.json``.
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
from dlo_client.contracts import AnyJob, MaskRLE
from PIL import Image
from playwright.sync_api import sync_playwright

from models.geometry.rle import encode
from tests.browser import Chromium
from tests.clients import samples
from tests.clients.browser_pages import place
from tests.clients.fake_service import FakeService, served

SIZE = (4000, 3000)
"""Width and height."""

_ROW, _WIDTH_PX = 1500, 24
_OTHERS = [row for row in range(180, 2900, 220) if abs(row - _ROW) > _WIDTH_PX]
_LEFT, _RIGHT = 200, 3800
_OPEN_MS = 3000
_LOOK_MS = 1000  # at the answer, before the first click
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
    """A JPEG with grain and thirteen cables."""
    rng = np.random.default_rng(0)
    pixels = rng.normal(90, 6, (SIZE[1] // 4, SIZE[0] // 4, 3)).clip(0, 255).astype(np.uint8)
    image = np.asarray(Image.fromarray(pixels).resize(SIZE, Image.Resampling.BICUBIC)).copy()
    image[_cable(_ROW)] = (200, 60, 40)
    for row in _OTHERS:
        image[_cable(row)] = (40, 70, 190)
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=92)
    return buffer.getvalue()


def _cable(row: int) -> tuple[slice, slice]:
    return slice(row - _WIDTH_PX // 2, row + _WIDTH_PX // 2), slice(_LEFT, _RIGHT)


def answered() -> tuple[AnyJob, bytes]:
    """What the service has found, twelve of the cables, and its probability as a PNG."""
    seen = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    instances = []
    for row in _OTHERS:
        mask = np.zeros_like(seen, bool)
        mask[_cable(row)] = True
        seen[mask] = 255
        line = [(float(x), row - 0.5) for x in np.linspace(_LEFT, _RIGHT, 150)]
        rle = MaskRLE(size=mask.shape, counts=encode(mask))
        more = {
            "id": len(instances) + 1,
            "centerline_xy": line,
            "width_px": _WIDTH_PX,
            "mask_rle": rle,
        }
        instances.append(samples.two_cables().instances[0].model_copy(update=more))
    job = samples.instances_job()
    found = {"width": SIZE[0], "height": SIZE[1], "instances": instances, "crossings": []}
    buffer = io.BytesIO()
    Image.fromarray(seen).save(buffer, "PNG")
    return job.model_copy(update={"result": job.result.model_copy(update=found)}), buffer.getvalue()


@contextmanager
def opened(job: AnyJob, probability: bytes) -> Iterator[Any]:
    """The label bench of a stand-in for the service that answers with this job."""
    service = FakeService()
    service.finished, service.file = job, probability
    with sync_playwright() as playwright, served(service.app()) as url:
        browser = Chromium(playwright)
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


def once(picture: bytes, job: AnyJob, probability: bytes) -> dict[str, float]:
    """Open the picture, draw a cable, drag its edge."""
    with opened(job, probability) as page:
        page.set_input_files(
            "#file", {"name": "large.jpg", "mimeType": "image/jpeg", "buffer": picture}
        )
        took = {"open": _took(page, "chosen", "opened")}
        page.wait_for_function(
            f"document.querySelectorAll('#instances button').length === {len(_OTHERS)}"
        )
        page.wait_for_timeout(_LOOK_MS)
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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--out", type=Path, default=Path("build/bench/pages.json"))
    asked = parser.parse_args()
    picture, (job, probability) = photograph(), answered()
    runs = [once(picture, job, probability) for _ in range(asked.repeats)]
    found: dict[str, Any] = {name: [round(run[name]) for run in runs] for name in runs[0]}
    medians = {name: statistics.median(values) for name, values in found.items()}
    result = {"ms": found, "median_ms": medians, "load": round(os.getloadavg()[0], 1)}
    print(json.dumps(result))
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.write_text(json.dumps(result))


if __name__ == "__main__":
    main()
