"""The pages of the real service in Firefox, where there is one: they load without an error, and the main flow works."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from services.page_frame import PAGES
from tests.firefox import FIREFOX, Firefox, firefox
from tests.processes import running_service

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(FIREFOX is None, reason="needs firefox-esr; the same flows run in Chromium"),
]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with running_service(tmp_path_factory.mktemp("data"), workers=1) as address:
        yield address


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Firefox]:
    with firefox(tmp_path_factory.mktemp("firefox") / "profile") as page:
        yield page


def test_every_page_loads_without_an_error(page: Firefox, address: str) -> None:
    for name in PAGES:
        page.open(f"{address}/viewer/{name}.html")
        page.wait_for("document.querySelector('#service.good') !== null")
    assert page.errors == []


def test_a_sample_picture_becomes_a_label_and_a_recipe(page: Firefox, address: str) -> None:
    page.open(address)
    page.evaluate("document.querySelector('#samples button').click()")
    page.wait_for("document.querySelectorAll('#instances button').length >= 4")
    page.evaluate("document.querySelector('#files a.button').click()")
    page.wait_for("location.pathname.endsWith('recipes.html') && !document.querySelector('#source')?.hidden")
    page.open(f"{address}/viewer/label.html")
    page.wait_for("document.body?.dataset.ready === 'yes'")
    page.evaluate("document.querySelector('#samples button').click()")
    page.wait_for("document.querySelectorAll('#instances button').length >= 4")
    page.evaluate("document.querySelector('#confirm').click()")
    page.open(f"{address}/viewer/label.html")
    page.wait_for("document.querySelector('#pictures .confirmed') !== null")
    assert page.errors == []
