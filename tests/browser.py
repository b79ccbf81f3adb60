"""A real browser for tests of pages: the fixture ``browser``, and the marks of tests that need it.

Opening and closing a context or a tab, scripts of a page and the end of Playwright have no time
limit there, and Chromium has been seen to hang for minutes, and once for good. Here all of it has
one: what opens is tried once more in a browser started anew, a test whose browser was lost is run
once more, what closes is left.
"""

from __future__ import annotations

import itertools
import os
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil
import pytest

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]
OPENS_WITHIN_S = 20.0
TEST_WITHIN_S = 240.0
"""All of a test, with what its pages need to open and close: above the longest, on a machine with
other work."""
NEEDS_BROWSER = [
    pytest.mark.system,
    pytest.mark.browser,
    pytest.mark.skipif(not CHROMIUM.exists(), reason=f"needs a browser at {CHROMIUM}"),
    # Playwright's words for a browser that is gone; and one that is killed while a tab opens can
    # leave it waiting.
    pytest.mark.flaky(reruns=2, only_rerun=["has been closed", "from pytest-timeout"]),
]
_NUMBERS = itertools.count(1)


class Chromium:
    """A browser that is started anew, once a call, where it opens nothing within ``within_s``."""

    def __init__(self, playwright: Any, within_s: float = OPENS_WITHIN_S) -> None:
        self._playwright = playwright
        self._within_s = within_s
        self._start()

    def new_page(self, *, shared: bool = False, **options: Any) -> Any:
        """A tab in a context of its own with these options, or in the one that is there already.
        Close the context of one that is not ``shared``. Playwright's error if the second browser
        hangs too."""
        try:
            return self._opened(shared, options, self._within_s)
        except self._playwright_error as error:
            warnings.warn(
                f"Chromium opened no page within {self._within_s:g} s, started anew: {error}",
                stacklevel=2,
            )
            self.close()
            self._start()
            return self._opened(shared, options, OPENS_WITHIN_S)

    def close(self) -> None:
        with suppress(self._playwright_error), self.bounded(self._within_s):
            self._browser.close()

    def put_away(self, opened: Any) -> None:
        """Closes a tab or a context; one that does not close in time goes with its browser, which
        is a warning."""
        with suppress(self._playwright_error), self.bounded(self._within_s):
            opened.close()
        if not self._browser.is_connected():
            warnings.warn(
                f"Chromium closed nothing within {self._within_s:g} s, or was gone before",
                stacklevel=2,
            )

    @property
    def processes(self) -> list[psutil.Process]:
        return processes(self._mark)

    def _start(self) -> None:
        # No option of Chromium: by it the process is found, which Playwright does not name.
        self._mark = f"--dlo-tests={os.getpid()}-{next(_NUMBERS)}"
        launch: Callable[..., Any] = self._playwright.chromium.launch
        for tries_left in (1, 0):
            try:
                self._browser = launch(
                    executable_path=CHROMIUM,
                    args=[*FLAGS, self._mark],
                    timeout=1000 * OPENS_WITHIN_S,
                )
                return
            except self._playwright_error as error:
                if not tries_left:
                    raise
                warnings.warn(f"Chromium did not start: {error}", stacklevel=2)

    def _opened(self, shared: bool, options: dict[str, Any], within_s: float) -> Any:
        with self.bounded(within_s):
            contexts = self._browser.contexts if shared else []
            return (contexts[0] if contexts else self._browser.new_context(**options)).new_page()

    @contextmanager
    def bounded(self, within_s: float) -> Iterator[None]:
        """Kills the browser if what is done meanwhile takes too long: that is then an error of
        Playwright."""
        with in_time(within_s, lambda: kill(self.processes)):
            yield

    @property
    def _playwright_error(self) -> type[Exception]:
        from playwright.sync_api import Error

        return Error


def processes(mark: str) -> list[psutil.Process]:
    """Those that were started with this argument."""
    found = psutil.process_iter(["cmdline"])
    return [process for process in found if mark in (process.info["cmdline"] or [])]


def kill(found: list[psutil.Process]) -> None:
    for process in found:
        with suppress(psutil.NoSuchProcess):
            process.kill()


@contextmanager
def in_time(within_s: float, late: Callable[[], object]) -> Iterator[None]:
    """Calls ``late`` from another thread if what is done meanwhile takes longer."""
    timer = threading.Timer(within_s, late)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def started_playwright() -> Iterator[Any]:
    """Playwright, whose own process is killed if it does not end; the test is skipped where it is
    not installed."""
    sync_api = pytest.importorskip("playwright.sync_api")
    others = set(psutil.Process().children())
    manager = sync_api.sync_playwright()
    playwright = manager.start()
    drivers = [process for process in psutil.Process().children() if process not in others]
    try:
        yield playwright
    finally:
        with in_time(OPENS_WITHIN_S, lambda: kill(drivers)):
            playwright.stop()


@pytest.fixture(scope="module")
def browser() -> Iterator[Chromium]:
    """One for the tests of a file; every page that they open in a context of its own has an empty
    database."""
    with started_playwright() as playwright:
        chromium = Chromium(playwright)
        yield chromium
        chromium.close()


@pytest.fixture(autouse=True)
def _browser_in_time(request: pytest.FixtureRequest) -> Iterator[None]:
    """A page that hangs in a test fails it, and does not hold up all the others."""
    if "browser" not in request.fixturenames:
        yield
        return
    with request.getfixturevalue("browser").bounded(TEST_WITHIN_S):
        yield
