"""Both clients: what they send, what they return, when they send again, which error they raise."""

from __future__ import annotations

import json
from pathlib import Path

import httpx
import pytest
from dlo_client import (
    ConnectionFailed,
    ImageRef,
    InstancesRequest,
    InstancesResult,
    InvalidArgument,
    NoopRequest,
    RetryPolicy,
    SegmentRequest,
    errors,
)
from dlo_client.contracts import FileRef, ImageInfo, JobPage, JobState

from tests.clients import samples
from tests.clients.conftest import Connect
from tests.clients.replies import Breaking, Reply, Script, ok, refusal, reply

QUEUED = samples.job(JobState.QUEUED)
LOST = httpx.ConnectError("no route")


def test_references_travel_as_json(connect: Connect) -> None:
    script = Script(ok(QUEUED, 202))
    connect(script).submit(SegmentRequest(image=ImageRef(id=samples.SHA), label="desk"))
    sent = script.requests[0]
    assert (sent.method, sent.url.path) == ("POST", "/v1/jobs")
    assert sent.headers["Content-Type"] == "application/json"
    body = json.loads(sent.content)
    assert body["kind"] == "segment"
    assert body["image"] == {"id": samples.SHA}
    assert "model" not in body


def test_pictures_travel_as_parts_in_order(connect: Connect, tmp_path: Path) -> None:
    path = tmp_path / "desk.png"
    path.write_bytes(b"from a file")
    script = Script(ok(QUEUED, 202))
    connect(script).submit(InstancesRequest(), images=[path, b"from memory"], mask=b"a mask")
    sent = script.requests[0]
    assert sent.headers["Content-Type"].startswith("multipart/form-data")
    order = [
        b'name="request"',
        b'filename="desk.png"',
        b"from a file",
        b"from memory",
        b'name="mask"',
        b"a mask",
    ]
    places = [sent.content.index(part) for part in order]
    assert places == sorted(places)
    assert sent.content.count(b'name="image"') == 2


def test_a_job_carries_its_kind_of_result(connect: Connect) -> None:
    job = connect(Script(ok(samples.instances_job()))).submit(InstancesRequest(), images=b"picture")
    assert isinstance(job.result, InstancesResult)
    assert job.result == samples.two_cables()


def test_the_wait_is_asked_of_the_service(connect: Connect) -> None:
    script = Script(ok(QUEUED, 202))
    client = connect(script)
    client.submit(NoopRequest(), wait=2.5)
    client.submit(NoopRequest())
    assert script.requests[0].url.params["wait"] == "2.5"
    assert script.requests[0].extensions["timeout"]["read"] == pytest.approx(22.5)
    assert "wait" not in script.requests[1].url.params


def test_a_lost_submission_is_repeated_under_the_same_key(connect: Connect) -> None:
    full = refusal(samples.refused(429), {"Retry-After": "0"})
    script = Script(LOST, full, ok(QUEUED, 202))
    connect(script).submit(NoopRequest(), images=b"picture")
    keys = [request.headers["Idempotency-Key"] for request in script.requests]
    assert len(keys) == 3
    assert len(set(keys)) == 1
    assert len({request.content for request in script.requests}) == 1


def test_every_attempt_has_the_id_of_its_call_and_the_error_has_that_of_the_log(
    connect: Connect,
) -> None:
    """A failure could not be found in the service's log: nothing that the caller knew was in it."""
    script = Script(LOST, refusal(samples.refused(500), {"X-Request-ID": "in the log"}))
    client = connect(script)
    with pytest.raises(errors.ServiceFault) as caught:
        client.submit(NoopRequest())
    assert caught.value.request_id == "in the log"
    first, second = (request.headers["X-Request-ID"] for request in script.requests)
    assert first == second
    with pytest.raises(errors.ServiceFault):
        client.get("abc")
    assert script.requests[-1].headers["X-Request-ID"] != first


def test_two_submissions_have_two_keys_unless_the_caller_gives_one(connect: Connect) -> None:
    script = Script(ok(QUEUED, 202))
    client = connect(script)
    client.submit(NoopRequest())
    client.submit(NoopRequest())
    client.submit(NoopRequest(), idempotency_key="mine")
    first, second, third = (request.headers["Idempotency-Key"] for request in script.requests)
    assert first != second
    assert third == "mine"


@pytest.mark.parametrize(
    "lost", [LOST, httpx.ReadTimeout("silence"), httpx.RemoteProtocolError("hung up")]
)
def test_what_may_pass_is_tried_a_bounded_number_of_times(
    connect: Connect, lost: Exception
) -> None:
    script = Script(lost)
    with pytest.raises(ConnectionFailed, match="http://service/v1/jobs/abc"):
        connect(script).get("abc")
    assert len(script.requests) == 3


@pytest.mark.parametrize(
    "answer",
    [
        refusal(samples.refused(500)),
        refusal(samples.refused(429)),
        refusal(samples.refused(503), {"Retry-After": "3600"}),
        refusal(samples.refused(422), {"Retry-After": "0"}),
    ],
    ids=["500", "429 without a time", "503 for too long", "422"],
)
def test_what_will_not_pass_is_not_tried_again(connect: Connect, answer: Reply) -> None:
    script = Script(answer)
    with pytest.raises(errors.APIError):
        connect(script).cancel("abc")
    assert len(script.requests) == 1


@pytest.mark.parametrize(
    ("status", "error"),
    [
        (400, errors.InvalidRequest),
        (401, errors.Unauthorized),
        (403, errors.Unauthorized),
        (404, errors.NotFound),
        (409, errors.Conflict),
        (410, errors.Gone),
        (413, errors.InvalidRequest),
        (422, errors.InvalidRequest),
        (429, errors.QueueFull),
        (500, errors.ServiceFault),
        (503, errors.Unavailable),
        (507, errors.StorageFull),
    ],
)
def test_a_refusal_is_the_error_of_its_status(
    connect: Connect, status: int, error: type[errors.APIError]
) -> None:
    problem = samples.refused(status, code="some_code")
    with pytest.raises(error) as caught:
        connect(Script(refusal(problem, {"Retry-After": "99"}))).get("abc")
    assert type(caught.value) is error
    assert caught.value.problem == problem
    assert caught.value.retry_after_s == 99


def test_an_error_says_which_field_is_wrong(connect: Connect) -> None:
    with pytest.raises(errors.InvalidRequest, match=r"threshold: must be at most 1"):
        connect(Script(refusal(samples.bad_threshold()))).submit(NoopRequest())


def test_a_proxys_error_page_is_an_api_error_too(connect: Connect) -> None:
    with pytest.raises(errors.ServiceFault, match="502 Bad Gateway: <h1>no</h1>"):
        connect(Script(reply(502, text="<h1>no</h1>"))).get("abc")


@pytest.mark.parametrize("answer", [reply(200, text="<h1>hello</h1>"), reply(302)])
def test_another_server_is_told_apart(connect: Connect, answer: Reply) -> None:
    with pytest.raises(errors.UnexpectedReply, match="http://service/v1/models"):
        connect(Script(answer)).networks()


def test_cancel_is_a_delete(connect: Connect) -> None:
    script = Script(ok(samples.job(JobState.CANCELLED)))
    assert connect(script).cancel(QUEUED).state is JobState.CANCELLED
    assert (script.requests[0].method, script.requests[0].url.path) == (
        "DELETE",
        f"/v1/jobs/{samples.JOB_ID}",
    )


def test_upload_sends_the_bytes_as_they_are(connect: Connect) -> None:
    info = ImageInfo(id=samples.SHA, sha256=samples.SHA, width=2, height=1, bytes=7)
    script = Script(ok(info, 201))
    assert connect(script).upload(b"picture") == info
    assert script.requests[0].content == b"picture"


def test_jobs_goes_through_all_pages(connect: Connect) -> None:
    pages = [JobPage(jobs=[QUEUED, QUEUED], next_cursor="more"), JobPage(jobs=[samples.job()])]
    script = Script(*map(ok, pages))
    found = list(connect(script).jobs(state=JobState.QUEUED, kind="noop", page_size=2))
    assert found == [*pages[0].jobs, *pages[1].jobs]
    first, second = (dict(request.url.params) for request in script.requests)
    assert first == {"limit": "2", "state": "queued", "kind": "noop"}
    assert second == first | {"cursor": "more"}


def test_a_file_name_cannot_leave_its_job(connect: Connect) -> None:
    script = Script(reply(200, content=samples.OVERLAY))
    assert connect(script).file(QUEUED, "../../models") == samples.OVERLAY
    assert script.requests[0].url.raw_path.endswith(b"/files/..%2F..%2Fmodels")


def test_networks_are_listed(connect: Connect) -> None:
    answer = reply(200, text=f"[{samples.network().model_dump_json()}]")
    assert connect(Script(answer)).networks() == [samples.network()]


@pytest.mark.parametrize(
    ("answer", "ready"), [(reply(200), True), (refusal(samples.refused(503)), False), (LOST, False)]
)
def test_ready_asks_once(connect: Connect, answer: Reply, ready: bool) -> None:
    script = Script(answer)
    assert connect(script).ready() is ready
    assert len(script.requests) == 1


def test_address_and_key_come_from_the_environment(
    connect: Connect, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DLO_URL", "http://cell/dlo/")
    monkeypatch.setenv("DLO_API_KEY", "secret")
    script = Script(ok(QUEUED))
    connect(script, url=None).get("abc")
    assert str(script.requests[0].url) == "http://cell/dlo/v1/jobs/abc"
    assert script.requests[0].headers["Authorization"] == "Bearer secret"
    connect(script, api_key="other").get("abc")
    assert script.requests[1].headers["Authorization"] == "Bearer other"


def test_a_key_from_a_file_may_end_in_a_line_break(connect: Connect) -> None:
    script = Script(ok(QUEUED))
    connect(script, api_key="secret\n").get("abc")
    assert script.requests[0].headers["Authorization"] == "Bearer secret"


@pytest.mark.parametrize("key", ["schlüssel", "one\ntwo", "one\0two"])
def test_a_key_that_is_no_header_is_refused_and_not_repeated(connect: Connect, key: str) -> None:
    with pytest.raises(InvalidArgument, match=r"^api_key: takes printable ASCII") as caught:
        connect(Script(LOST), api_key=key)
    assert key not in str(caught.value)


@pytest.mark.parametrize(
    ("method", "arguments", "argument"),
    [
        ("get", [""], "job"),
        ("get", [None], "job"),
        ("cancel", [7], "job"),
        ("events", [""], "job"),
        ("wait", ["abc"], "job"),
        ("file", ["abc", ""], "file"),
        ("file", ["abc", None], "file"),
        ("submit", [{"kind": "noop"}], "request"),
        ("upload", [None], "image"),
    ],
)
def test_an_argument_of_another_type_is_named(
    connect: Connect, method: str, arguments: list[object], argument: str
) -> None:
    """An empty id asked for the list of jobs; others ended in AttributeError."""
    client = connect(Script(LOST))
    with pytest.raises(InvalidArgument, match=f"^{argument}: "):
        list(getattr(client, method)(*arguments))


def test_a_mask_that_is_none_is_named(connect: Connect) -> None:
    client = connect(Script(LOST))
    with pytest.raises(InvalidArgument, match=r"^mask: float is no picture"):
        client.run(InstancesRequest(), b"picture", mask=0.5)
    with pytest.raises(InvalidArgument, match=r"^idempotency_key: "):
        client.submit(NoopRequest(), idempotency_key="schlüssel")


def test_a_closed_client_is_said_to_be_closed(connect: Connect) -> None:
    client = connect(Script(ok(QUEUED)))
    getattr(client, "aclose" if hasattr(client, "_runner") else "close")()
    for call in (lambda: client.get("abc"), lambda: list(client.events("abc"))):
        with pytest.raises(ConnectionFailed, match="has been closed"):
            call()


def test_a_file_may_be_named_by_its_entry_in_the_job(connect: Connect) -> None:
    script = Script(reply(200, content=samples.OVERLAY))
    entry = FileRef(name="overlay.png", media_type="image/png", bytes=1, sha256=samples.SHA)
    assert connect(script).file("abc", entry) == samples.OVERLAY
    assert script.requests[0].url.path == "/v1/jobs/abc/files/overlay.png"


@pytest.mark.parametrize("url", ["localhost:8000", "cell", "http://", "http://[::", "ftp://cell"])
def test_what_is_no_address_is_named(connect: Connect, url: str) -> None:
    with pytest.raises(ConnectionFailed, match="is not an address") as caught:
        connect(Script(LOST), url=url)
    assert repr(url) in str(caught.value)


def test_a_garbled_reply_is_a_failed_connection(connect: Connect) -> None:
    garbled = reply(headers={"Content-Encoding": "gzip"}, stream=Breaking("not gzip"))
    with pytest.raises(ConnectionFailed):
        connect(Script(garbled)).get("abc")


def test_no_key_no_header(connect: Connect, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DLO_API_KEY", raising=False)
    script = Script(ok(QUEUED))
    connect(script).get("abc")
    assert "Authorization" not in script.requests[0].headers


def test_the_pause_doubles_and_has_a_limit() -> None:
    policy = RetryPolicy(attempts=6, first_pause_s=1.0, longest_pause_s=5.0)
    pauses = [policy.pause_s(attempt, LOST) for attempt in range(1, 7)]
    assert pauses == [1.0, 2.0, 4.0, 5.0, 5.0, None]
