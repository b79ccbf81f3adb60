"""The browser of the page tests: one that hangs costs seconds and is reported."""

from __future__ import annotations

import pytest

from tests.browser import NEEDS_BROWSER, Chromium

pytestmark = NEEDS_BROWSER


def test_a_browser_that_hangs_is_started_anew_and_reported() -> None:
    """Opening a context hung for three minutes, before a test that passes alone."""
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        chromium = Chromium(playwright, within_s=1.0)
        hung = chromium.processes
        for process in hung:
            process.suspend()
        with pytest.warns(UserWarning, match="no page within 1 s"):
            page = chromium.new_page()
        assert page.evaluate("1 + 1") == 2
        assert chromium.processes
        assert not set(hung) & set(chromium.processes)
        assert not any(process.is_running() for process in hung)
        chromium.close()
