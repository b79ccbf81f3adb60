"""Pictures of the pages for the documentation, of the real service in a real browser.

python -m tests.screenshots docs/images/pages
"""

from __future__ import annotations

import argparse
import io
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from PIL import Image

from tests.browser import Chromium, started_playwright
from tests.processes import ROOT, running_service

DESKTOP, TABLET = (1440, 900), (1024, 768)
SAMPLES = ROOT / "services" / "viewer" / "samples"


def pictures(page: Any) -> None:
    page.set_input_files(
        "#file", [SAMPLES / name for name in ("plain.jpg", "busy.jpg", "industrial.jpg")]
    )
    page.wait_for_function(
        "document.querySelectorAll('#film .mark.ok, #film .mark.unsure').length === 3"
    )
    page.click("#film button >> nth=1")


def harness(page: Any) -> None:
    page.set_input_files("#file", SAMPLES / "harness_crossed.png")
    page.wait_for_selector("#sections button")
    script = "(s) => { s.value = 0.5; s.dispatchEvent(new Event('input', { bubbles: true })); }"
    page.locator("#share").evaluate(script)


def reconstruction(page: Any) -> None:
    page.click("#sample")
    page.wait_for_selector("#views img")


def label(page: Any) -> None:
    page.wait_for_selector("body[data-ready]")
    page.set_input_files("#file", [SAMPLES / "busy.jpg", SAMPLES / "plain.jpg"])
    page.wait_for_function(
        "(document.querySelector('#pictures').textContent.match(/0\\.\\d\\d/g) || []).length === 2"
    )
    page.wait_for_selector("#instances button")


def tracks(page: Any) -> None:
    """A picture that moves: the same one, cut out further and further to the right."""
    picture = Image.open(SAMPLES / "plain.jpg")
    files = []
    for shift in range(3):
        buffer = io.BytesIO()
        picture.crop((8 * shift, 0, picture.width - 24 + 8 * shift, picture.height)).save(
            buffer, "JPEG"
        )
        files.append(
            {"name": f"{shift}.jpg", "mimeType": "image/jpeg", "buffer": buffer.getvalue()}
        )
    page.set_input_files("#file", files)
    page.wait_for_selector("#run:not([disabled])")
    page.click("#run")
    page.wait_for_function("document.querySelector('#at').value === '3 / 3'")
    page.wait_for_selector("#cables button")
    page.wait_for_selector("#progress", state="hidden")


def recipes(page: Any) -> None:
    """One of a job of the page of pictures."""
    page.goto(page.url.replace("recipes", "index"))
    page.set_input_files("#file", SAMPLES / "busy.jpg")
    page.click("#files a.button")
    page.wait_for_selector("#source:not([hidden])")
    page.fill("#name", "shelf 3")
    page.click("#store")
    page.wait_for_selector("#dry-run:not([disabled])")
    page.click("#dry-run")
    page.wait_for_selector("#cancel", state="hidden")


def jobs(page: Any) -> None:
    page.wait_for_load_state("networkidle")


PAGES: dict[str, tuple[str, Callable[[Any], None]]] = {
    "pictures": ("", pictures),
    "harness": ("viewer/harness.html", harness),
    "reconstruction": ("viewer/reconstruction.html", reconstruction),
    "tracks": ("viewer/tracks.html", tracks),
    "label": ("viewer/label.html", label),
    "jobs": ("viewer/jobs.html", jobs),
    "recipes": ("viewer/recipes.html", recipes),
}
"""Path of each page, and what is done on it before it is pictured."""

Shot = tuple[str, str, tuple[int, int], str, str]
SHOTS: list[Shot] = [
    *(
        (name, name, DESKTOP, "en-US", "dark" if name == "reconstruction" else "light")
        for name in PAGES
    ),
    ("label_tablet", "label", TABLET, "de-DE", "light"),
    ("pictures_tablet", "pictures", TABLET, "de-DE", "dark"),
]
"""Name of the file, page, size, language, light or dark: what the documentation shows."""

EVERY: list[Shot] = [
    (
        f"{name}_{size[0]}_{scheme}",
        name,
        size,
        "de-DE" if (size == TABLET) == (scheme == "light") else "en-US",
        scheme,
    )
    for name in PAGES
    for size in (DESKTOP, TABLET)
    for scheme in ("light", "dark")
]
"""Every page at both sizes, light and dark, each of them in one language at one size and in the
other at the other."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", help="default: all of the documentation")
    parser.add_argument(
        "--every", action="store_true", help="every page at both sizes, light and dark"
    )
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as data,
        running_service(Path(data), workers=1) as url,
        browser() as opened,
    ):
        for shot in EVERY if arguments.every else SHOTS:
            if not arguments.names or shot[0] in arguments.names:
                taken(opened, url, shot, arguments.out)


def taken(opened: Chromium, url: str, shot: Shot, out: Path) -> None:
    """A picture of one page; what its console has to say is printed."""
    name, page_name, (width, height), locale, scheme = shot
    path, act = PAGES[page_name]
    viewport = {"width": width, "height": height}
    touched = (width, height) == TABLET
    page = opened.new_page(
        viewport=viewport, locale=locale, color_scheme=scheme, has_touch=touched, bypass_csp=True
    )
    page.on(
        "console",
        lambda message: (
            print(name, message.type, message.text) if message.type == "error" else None
        ),
    )
    page.on("pageerror", lambda error: print(name, error))
    page.set_default_timeout(120_000)
    page.goto(f"{url}/{path}")
    act(page)
    page.wait_for_timeout(500)
    page.screenshot(path=out / f"{name}.jpg", type="jpeg", quality=80)
    opened.put_away(page.context)


@contextmanager
def browser() -> Iterator[Chromium]:
    with started_playwright() as playwright:
        opened = Chromium(playwright)
        yield opened
        opened.close()


if __name__ == "__main__":
    main()
