"""Both clients behind one synchronous face, so that every test of behavior runs on each of them; a
page."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest
from dlo_client import AsyncClient, Client, RetryPolicy

from tests.browser import Chromium
from tests.clients.browser_pages import opened
from tests.clients.fake_service import FakeService

Handler = Callable[[httpx.Request], httpx.Response]
Connect = Callable[..., Any]

AT_ONCE = RetryPolicy(attempts=3, first_pause_s=0.0)


class OnLoop:
    """An AsyncClient whose methods return values and lists."""

    def __init__(self, client: AsyncClient, runner: asyncio.Runner) -> None:
        self._client = client
        self._runner = runner

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def call(*args: Any, **more: Any) -> Any:
            made = getattr(self._client, name)(*args, **more)
            return self._runner.run(_list(made) if inspect.isasyncgen(made) else made)

        return call


async def _list(items: Any) -> list[Any]:
    return [item async for item in items]


@pytest.fixture(params=["sync", "async"])
def connect(request: pytest.FixtureRequest) -> Iterator[Connect]:
    """``connect(handler)``: a client whose network is ``handler``; it retries without pauses."""
    with asyncio.Runner() as runner:

        def make(
            handler: Handler, url: str = "http://service", retry: RetryPolicy = AT_ONCE, **more: Any
        ) -> Any:
            transport = httpx.MockTransport(handler)
            if request.param == "sync":
                return Client(url, retry=retry, transport=transport, **more)
            return OnLoop(AsyncClient(url, retry=retry, transport=transport, **more), runner)

        yield make


@pytest.fixture
def service() -> FakeService:
    return FakeService()


@pytest.fixture
def page(browser: Chromium, service: FakeService) -> Iterator[Any]:
    with opened(browser, service) as page:
        yield page
