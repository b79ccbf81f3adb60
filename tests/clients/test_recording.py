"""A cell's requests in a folder and on another network: kept whole, compared fairly, ended with a
verdict."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from dlo_client import Client
from dlo_client.commands import record_commands  # noqa: F401  it registers its commands
from dlo_client.commands.app import app
from dlo_client.contracts import ImageRef, InstancesRequest, NoopRequest
from dlo_client.errors import JobFailed
from dlo_client.recording import RECORD, Recorder, RecordingError, note_outcome, read_recording
from dlo_client.replay import alikeness, compared, replay
from typer.testing import CliRunner

from tests.clients import samples


class Service:
    """Answers with two cables, or with those that ``change`` makes of them; pictures that are torn
    fail."""

    def __init__(self, change: Callable[[dict[str, Any]], None] = lambda result: None) -> None:
        self.change = change
        self.requests: list[dict[str, Any]] = []

    def __call__(self, request: httpx.Request) -> httpx.Response:
        body = request.content
        if b'name="request"' in body:
            self.requests.append(
                json.loads(body.split(b'name="request"\r\n\r\n')[1].split(b"\r\n--")[0])
            )
        if b"torn" in body:
            job = samples.failed(samples.bad_threshold())
            return httpx.Response(200, text=job.model_dump_json())
        answer = json.loads(samples.instances_job().model_dump_json())
        self.change(answer["result"])
        return httpx.Response(200, text=json.dumps(answer))


def client(service: Service) -> Client:
    return Client("http://service", transport=httpx.MockTransport(service))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Four requests: one good, one bad, one that nobody judged, one that failed."""
    with client(Service()) as open_client:
        recorder = Recorder(open_client, tmp_path / "cell")
        for picture, outcome in ((b"a", "good"), (b"b", "bad"), (b"c", None), (b"torn", None)):
            try:
                entry, _ = recorder.run(InstancesRequest(effort="fast"), picture)
            except JobFailed:
                continue
            if outcome:
                recorder.outcome(entry, outcome, "slipped")
    return tmp_path / "cell"


def verdicts(folder: Path, service: Service, **changes: Any) -> list[str]:
    with client(service) as open_client:
        return [
            row.verdict for row in replay(open_client, folder, read_recording(folder), changes).rows
        ]


def one_fewer(result: dict[str, Any]) -> None:
    result["instances"] = result["instances"][:1]
    result["crossings"] = []


def test_a_recording_holds_requests_pictures_answers_and_outcomes(folder: Path) -> None:
    entries = read_recording(folder)
    assert [entry.outcome for entry in entries] == ["good", "bad", None, None]
    assert [entry.result is None for entry in entries] == [False, False, False, True]
    assert entries[3].problem["code"] == samples.bad_threshold().code
    assert entries[0].request["effort"] == "fast"
    assert (folder / "pictures" / entries[0].images[0]).read_bytes() == b"a"


def test_the_same_answers_are_the_same(folder: Path) -> None:
    service = Service()
    assert verdicts(folder, service) == ["same", "still_bad", "same", "still_fails"]
    assert [r["effort"] for r in service.requests] == ["fast"] * 4


def test_another_answer_is_judged_by_what_became_of_the_one_before(folder: Path) -> None:
    assert verdicts(folder, Service(one_fewer)) == [
        "at_risk",
        "may_be_mended",
        "changed",
        "still_fails",
    ]


def test_what_fails_now_is_broken_and_what_failed_then_may_work(folder: Path) -> None:
    for file in (folder / "pictures").iterdir():
        torn = file.read_bytes() == b"torn"
        file.write_bytes(b"whole" if torn else b"torn")
    assert verdicts(folder, Service()) == ["broken", "broken", "broken", "works_now"]


def test_fields_are_asked_for_anew(folder: Path) -> None:
    service = Service()
    verdicts(folder, service, model="cell7", effort="thorough")
    assert {(r["model"], r["effort"]) for r in service.requests} == {("cell7", "thorough")}


def test_a_recording_whose_last_line_was_cut_off_is_read(folder: Path) -> None:
    with (folder / RECORD).open("a") as lines:
        lines.write('{"id": "x", "requ')
    assert len(read_recording(folder)) == 4


def test_the_last_word_on_an_outcome_counts(folder: Path) -> None:
    first = read_recording(folder)[0]
    note_outcome(folder, first.id, "bad", "it was the wrong cable")
    assert (read_recording(folder)[0].outcome, read_recording(folder)[0].note) == (
        "bad",
        "it was the wrong cable",
    )


def test_pictures_that_do_not_go_along_are_not_recorded(tmp_path: Path) -> None:
    with client(Service()) as open_client, pytest.raises(RecordingError, match="by its id"):
        Recorder(open_client, tmp_path).run(InstancesRequest(image=ImageRef(id=samples.SHA)))


def test_a_service_that_is_away_ends_the_replay(folder: Path) -> None:
    def away(_: httpx.Request) -> httpx.Response:
        raise httpx.ConnectError("away")

    from dlo_client.errors import ConnectionFailed
    from dlo_client.retry import RetryPolicy

    transport = httpx.MockTransport(away)
    with (
        Client("http://service", transport=transport, retry=RetryPolicy(attempts=1)) as gone,
        pytest.raises(ConnectionFailed),
    ):
        replay(gone, folder, read_recording(folder)[:1])


def test_answers_of_other_kinds_are_compared_field_by_field() -> None:
    before = {"kind": "segment", "coverage": 0.2, "models": [1], "width": 10}
    alike, what = compared(before, before | {"coverage": 0.19, "models": [2]})
    assert alike == pytest.approx(0.95)
    assert "coverage 95 %" in what
    assert compared(before, before) == (1.0, "the same")


@pytest.mark.parametrize(
    ("a", "b", "alike"),
    [
        (1, 1.0, 1),
        (2, 1, 0.5),
        (0, 1e-12, 1),
        ("a", "b", 0),
        (None, 0, 0),
        (True, 1, 1),
        ([1, 2], [1], 0),
        ({"x": 1}, {"y": 1}, 0),
        ({"x": [4, 1]}, {"x": [4, 2]}, 0.5),
        (1, -1, 0),
    ],
)
def test_how_alike_values_are(a: Any, b: Any, alike: float) -> None:
    assert alikeness(a, b) == pytest.approx(alike)


@pytest.fixture
def dlo(tmp_path: Path):
    def run(service: Service, *arguments: object):
        return CliRunner().invoke(
            app, [str(a) for a in arguments], obj=httpx.MockTransport(service)
        )

    return run


def test_the_commands_record_judge_and_replay(dlo, tmp_path: Path) -> None:
    picture, cell, report = tmp_path / "a.png", tmp_path / "cell", tmp_path / "report.json"
    picture.write_bytes(b"a")
    done = dlo(
        Service(),
        "record",
        cell,
        picture,
        picture,
        "--request",
        '{"kind": "instances", "effort": "fast"}',
    )
    assert done.exit_code == 0, done.output
    entry = read_recording(cell)[0].id
    assert entry in done.stdout
    assert dlo(Service(), "outcome", cell, entry, "good", "--note", "picked").exit_code == 0
    assert dlo(Service(), "replay", cell).exit_code == 0
    done = dlo(Service(one_fewer), "replay", cell, "--model", "cell7", "--report", report)
    assert done.exit_code == 1
    assert "could be used then, is another answer now" in done.stdout
    saved = json.loads(report.read_text())
    assert (saved["passed"], saved["changes"]) == (False, {"model": "cell7"})
    assert [row["verdict"] for row in saved["rows"]] == ["at_risk", "changed"]


def test_bad_words_are_named(dlo, tmp_path: Path) -> None:
    assert (
        "there" in dlo(Service(), "replay", tmp_path / "none").stderr
        or "cannot be read" in dlo(Service(), "replay", tmp_path / "none").stderr
    )
    (tmp_path / RECORD).write_text("")
    assert "good or bad" in dlo(Service(), "outcome", tmp_path, "x", "fine").stderr
    assert (
        "no request of it has the id x" in dlo(Service(), "outcome", tmp_path, "x", "good").stderr
    )


def test_a_request_of_another_version_is_named(tmp_path: Path) -> None:
    (tmp_path / "pictures").mkdir()
    (tmp_path / RECORD).write_text(
        json.dumps({"id": "1", "request": {"kind": "noop", "old": 1}, "images": []}) + "\n"
    )
    [entry] = read_recording(tmp_path)
    with pytest.raises(RecordingError, match="none for this version"):
        entry.asked()
    assert NoopRequest().kind == "noop"
