"""``dlo review``: pictures into a folder, out of the service, and on to the page that corrects."""

from __future__ import annotations

import json
from pathlib import Path

import httpx
import pytest
from dlo_client.commands import review_commands
from dlo_client.commands.app import app
from typer.testing import CliRunner

PICTURE = {
    "id": "ab" * 32,
    "certainty": 0.25,
    "doubt": "none was found",
    "bytes": 9,
    "seen_at": "2026-11-28T00:00:00Z",
}


class Service:
    def __init__(self, count: int = 1) -> None:
        self.count = count
        self.asked: list[tuple[str, str]] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.asked.append((request.method, request.url.path))
        if request.url.path == "/v1/unsure":
            return httpx.Response(200, text=json.dumps([PICTURE] * self.count))
        return (
            httpx.Response(204)
            if request.method == "DELETE"
            else httpx.Response(200, content=b"\x89PNG picture")
        )


@pytest.fixture
def review(monkeypatch: pytest.MonkeyPatch):
    opened: list[str] = []
    monkeypatch.setattr(review_commands.webbrowser, "open", opened.append)

    def run(service: Service, *arguments: object):
        done = CliRunner().invoke(
            app, ["review", *map(str, arguments)], obj=httpx.MockTransport(service)
        )
        return done, opened

    return run


def test_pictures_come_once_and_the_page_opens(review, tmp_path: Path) -> None:
    service = Service()
    done, opened = review(service, tmp_path / "out")
    assert done.exit_code == 0, done.output
    [file] = (tmp_path / "out").iterdir()
    assert (file.suffix, file.read_bytes()) == (".png", b"\x89PNG picture")
    assert opened == ["http://127.0.0.1:8000/viewer/label.html"]
    assert ("DELETE", f"/v1/unsure/{PICTURE['id']}") in service.asked


def test_they_may_stay_and_no_page_opens(review, tmp_path: Path) -> None:
    service = Service(3)
    done, opened = review(service, tmp_path / "out", "--keep", "--no-browser", "--most", 2)
    assert done.exit_code == 0
    assert len(list((tmp_path / "out").iterdir())) == 2
    assert opened == []
    assert "DELETE" not in {method for method, _ in service.asked}


def test_nothing_to_review_is_said(review, tmp_path: Path) -> None:
    done, opened = review(Service(0), tmp_path / "out")
    assert "nothing to review" in done.stdout
    assert opened == []
