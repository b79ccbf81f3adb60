"""Pictures of the pages for the documentation, of the real service in a real browser.

python -m tests.screenshots docs/images/pages
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from playwright.sync_api import sync_playwright

from tests.browser import CHROMIUM, FLAGS
from tests.processes import ROOT, running_service

DESKTOP, TABLET = (1440, 900), (1024, 768)
SAMPLES = ROOT / "services" / "viewer" / "samples"


def pictures(page: Any) -> None:
    page.set_input_files("#file", [SAMPLES / name for name in ("plain.jpg", "busy.jpg", "industrial.jpg")])
    page.wait_for_function("document.querySelectorAll('#film .mark.ok, #film .mark.unsure').length === 3")
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
    page.wait_for_function("(document.querySelector('#pictures').textContent.match(/0\\.\\d\\d/g) || []).length === 2")
    page.wait_for_selector("#instances button")


def nothing(page: Any) -> None:
    page.wait_for_load_state("networkidle")


SHOTS: list[tuple[str, str, Callable[[Any], None], tuple[int, int], str, str]] = [
    ("pictures", "", pictures, DESKTOP, "en-US", "light"),
    ("harness", "viewer/harness.html", harness, DESKTOP, "en-US", "light"),
    ("label", "viewer/label.html", label, DESKTOP, "en-US", "light"),
    ("reconstruction", "viewer/reconstruction.html", reconstruction, DESKTOP, "en-US", "dark"),
    ("jobs", "viewer/jobs.html", nothing, DESKTOP, "en-US", "light"),
    ("label_tablet", "viewer/label.html", label, TABLET, "de-DE", "light"),
    ("pictures_tablet", "", pictures, TABLET, "de-DE", "dark"),
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("names", nargs="*", help="default: all")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as data, running_service(Path(data), workers=1) as url, browser() as opened:
        for name, path, act, (width, height), locale, scheme in SHOTS:
            if arguments.names and name not in arguments.names:
                continue
            context = opened.new_context(
                viewport={"width": width, "height": height}, locale=locale, color_scheme=scheme, bypass_csp=True
            )
            page = context.new_page()
            page.set_default_timeout(120_000)
            page.goto(f"{url}/{path}")
            act(page)
            page.wait_for_timeout(500)
            page.screenshot(path=arguments.out / f"{name}.jpg", type="jpeg", quality=80)
            context.close()


@contextmanager
def browser() -> Iterator[Any]:
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield opened
        opened.close()


if __name__ == "__main__":
    main()
