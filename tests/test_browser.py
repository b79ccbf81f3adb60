"""The browser of the page tests: one that hangs costs seconds and is reported."""

from __future__ import annotations

import time

import psutil
import pytest

from tests import browser
from tests.browser import NEEDS_BROWSER, Chromium, started_playwright

sync_api = pytest.importorskip("playwright.sync_api")
pytestmark = [*NEEDS_BROWSER, pytest.mark.timeout(60)]


def ended(processes: list[psutil.Process], within_s: float = 30.0) -> bool:
    """Whether all end in time. A killed process is there for a moment, and as a zombie until its
    parent asks for it."""
    until = time.monotonic() + within_s
    while time.monotonic() < until:
        if not any(_alive(process) for process in processes):
            return True
        time.sleep(0.05)
    return False


def _alive(process: psutil.Process) -> bool:
    try:
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


def test_a_browser_that_hangs_is_started_anew_and_reported() -> None:
    """Opening a context hung for three minutes, before a test that passes alone."""
    with started_playwright() as playwright:
        chromium = Chromium(playwright, within_s=1.0)
        hung = chromium.processes
        for process in hung:
            process.suspend()
        with pytest.warns(UserWarning, match="no page within 1 s"):
            page = chromium.new_page()
        assert page.evaluate("1 + 1") == 2
        assert chromium.processes
        assert not set(hung) & set(chromium.processes)
        assert ended(hung)
        chromium.close()


def test_a_page_that_does_not_close_is_left_with_its_browser() -> None:
    """Closing has no time limit in Playwright."""
    with started_playwright() as playwright:
        chromium = Chromium(playwright)
        page = chromium.new_page()
        chromium._within_s = 1.0
        for process in chromium.processes:
            process.suspend()
        with pytest.warns(UserWarning, match="closed nothing within 1 s"):
            chromium.put_away(page)
        assert chromium.new_page().evaluate("1 + 1") == 2
        chromium.close()


def test_a_script_that_does_not_end_fails_its_test() -> None:
    with started_playwright() as playwright:
        chromium = Chromium(playwright)
        page = chromium.new_page()
        with pytest.raises(sync_api.Error, match="has been closed"), chromium.bounded(1.0):
            page.evaluate("new Promise(() => {})")
        chromium.close()


def test_a_driver_that_hangs_is_ended(monkeypatch) -> None:
    monkeypatch.setattr(browser, "OPENS_WITHIN_S", 1.0)
    others = set(psutil.Process().children())
    with started_playwright():
        (driver,) = set(psutil.Process().children()) - others
        driver.suspend()
    assert ended([driver])
