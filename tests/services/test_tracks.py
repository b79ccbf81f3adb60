"""``/v1/tracks``: begin, send frames over HTTP and a WebSocket, look, end; who may, and what bad
input is answered."""

from __future__ import annotations

import json
import threading
import time

import httpx
import pytest
from dlo_client import Client
from dlo_client.contracts import (
    FrameResult,
    InstancesRequest,
    InstancesResult,
    SceneStatus,
    TrackInfo,
    TrackState,
)
from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect
from websockets.sync.client import connect

from services import frames
from services.app import create_app
from tests.processes import wait_until
from tests.services import samples
from tests.services.test_keys import as_, entry
from workers import problems
from workers.record import REQUEST

UNKNOWN = "0" * 32


def answered(request: InstancesRequest) -> InstancesResult:
    """As a worker would, without looking."""
    before = request.previous or TrackState()
    track = before.model_copy(update={"frame": before.frame + 1, "time_s": request.time_s})
    return InstancesResult(
        width=40,
        height=30,
        method="section_matching",
        threshold=0.5,
        instances=[],
        crossings=[],
        cables=[],
        cable_crossings=[],
        track=track,
        status=SceneStatus(code="none_found", limit=0.8, reasons=[]),
        models=[],
    )


class Worker:
    """Ends every job that it finds, in a thread; waits while it is held."""

    def __init__(self, job_queue, ledger) -> None:
        self.requests: list[InstancesRequest] = []
        self.fails = False
        self.free = threading.Event()
        self.free.set()
        self._over = threading.Event()
        self._client, self._ledger = job_queue._client, ledger
        self._active = job_queue._keys.active
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.wait(0.005):
            for job_id in self._client.smembers(self._active) if self.free.is_set() else ():
                if (claim := self._ledger.claim(job_id, "by hand")) is None:
                    continue
                request = REQUEST.validate_json(claim.request)
                self.requests.append(request)
                if self.fails:
                    self._ledger.fail(
                        claim, problems.invalid("time_s", "is before", "invalid_request")
                    )
                else:
                    self._ledger.succeed(claim, answered(request), [], {})

    def close(self) -> None:
        self._over.set()
        self._thread.join()


@pytest.fixture
def worker(job_queue, ledger):
    worker = Worker(job_queue, ledger)
    yield worker
    worker.close()


@pytest.fixture
def track(client) -> str:
    response = client.post("/v1/tracks", json={"effort": "fast", "label": "cell 3"})
    assert response.status_code == 201, response.text
    assert response.headers["location"] == f"/v1/tracks/{response.json()['id']}"
    return response.json()["id"]


def send(client, track: str, picture: bytes | None = None, **more):
    return client.post(f"/v1/tracks/{track}/frames", content=picture or samples.encoded(), **more)


def test_frames_continue_the_state_of_the_frame_before(client, track, worker):
    for number in (1, 2, 3):
        frame = FrameResult.model_validate(
            send(client, track, params={"time_s": 0.5 * number}).json()
        )
        assert (frame.frame, frame.time_s, frame.track.frame) == (number, 0.5 * number, number)
    assert [request.previous.frame for request in worker.requests] == [0, 1, 2]
    assert {
        (request.effort, request.timeout_s, tuple(request.files)) for request in worker.requests
    } == {("fast", 20.0, ())}
    seen = TrackInfo.model_validate(client.get(f"/v1/tracks/{track}").json())
    assert (seen.frames, seen.cables, seen.label) == (3, 0, "cell 3")


def test_another_replica_answers_the_next_frame(client, track, worker, service_settings):
    assert send(client, track).json()["frame"] == 1
    with TestClient(create_app(service_settings)) as other:
        assert send(other, track).json()["frame"] == 2


def test_a_mask_beside_the_picture_and_alone(client, track, worker):
    files = {"image": samples.encoded(), "mask": samples.encoded(samples.pixels(mode="L"))}
    client.post(f"/v1/tracks/{track}/frames", files=files)
    client.post(f"/v1/tracks/{track}/frames", files={"mask": files["mask"]})
    both, alone = worker.requests
    assert both.image is not None
    assert both.mask == alone.mask
    assert alone.image is None


def test_the_pictures_of_frames_are_soon_swept_away(client, app, track, worker):
    """At ten frames a second a day of them would fill any disk."""
    blobs = app.state.backend.blobs
    send(client, track)
    (blob_id,) = {request.image.id for request in worker.requests}
    assert blobs.path(blob_id).is_file()
    assert blobs.sweep(time.time()) == 0
    assert blobs.sweep(time.time() + 130) == 1


def test_a_picture_that_was_uploaded_before_stays(client, app, track, worker):
    blob_id = client.post("/v1/images", content=samples.encoded()).json()["id"]
    before = app.state.backend.blobs.path(blob_id).stat().st_mtime
    send(client, track)
    assert app.state.backend.blobs.path(blob_id).stat().st_mtime >= before


def test_a_track_that_is_ended_is_unknown(client, track, problem):
    assert client.delete(f"/v1/tracks/{track}").status_code == 204
    assert client.delete(f"/v1/tracks/{track}").status_code == 404
    problem(client.get(f"/v1/tracks/{track}"), 404, "unknown_track")
    problem(send(client, track), 404, "unknown_track")


@pytest.mark.parametrize("track_id", [UNKNOWN, "x", "G" * 32, "a" * 5000, "%00"])
def test_unknown_tracks(client, problem, track_id):
    problem(client.get(f"/v1/tracks/{track_id}"), 404, "unknown_track")
    problem(send(client, track_id), 404, "unknown_track")


def test_no_more_tracks_than_may_be(service_settings, problem):
    app = create_app(service_settings.model_copy(update={"max_tracks": 2}))
    with TestClient(app) as client:
        ids = [client.post("/v1/tracks").json()["id"] for _ in range(2)]
        response = client.post("/v1/tracks")
        assert problem(response, 429, "too_many_tracks")
        assert response.headers["retry-after"]
        client.delete(f"/v1/tracks/{ids[0]}")
        assert client.post("/v1/tracks").status_code == 201


def test_a_track_expires(service_settings):
    app = create_app(service_settings.model_copy(update={"track_ttl_s": 0.05}))
    with TestClient(app) as client:
        track = client.post("/v1/tracks").json()["id"]
        wait_until(lambda: client.get(f"/v1/tracks/{track}").status_code == 404, 10.0)


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"method": "x"}, "method"),
        ({"efort": "fast"}, "efort"),
        ({"timeout_s": 61}, "timeout_s"),
        ([], None),
    ],
)
def test_bad_options(client, problem, options, field):
    problem(client.post("/v1/tracks", json=options), 422, "invalid_request", field)


@pytest.mark.parametrize(
    "picture", [samples.REFUSED["text"], samples.REFUSED["truncated PNG"], samples.bomb()]
)
def test_bad_pictures_leave_the_track_as_it_was(client, track, worker, problem, picture):
    problem(send(client, track, picture), 422, "invalid_image", "image")
    assert send(client, track).json()["frame"] == 1


def test_what_is_no_picture_by_its_type(client, track, problem):
    problem(send(client, track, headers={"content-type": "text/plain"}), 415)
    problem(
        client.post(f"/v1/tracks/{track}/frames", files={"picture": b"x"}), 422, field="picture"
    )
    problem(send(client, track, params={"time_s": "nan"}), 422, field="time_s")


def test_sizes_that_differ(client, track, problem):
    files = {"image": samples.encoded(), "mask": samples.encoded(samples.pixels(20, 20, "L"))}
    problem(client.post(f"/v1/tracks/{track}/frames", files=files), 422, "size_mismatch", "mask")


def test_a_frame_whose_job_fails_is_answered_with_its_problem(client, track, worker, problem):
    worker.fails = True
    problem(send(client, track), 422, "invalid_request", "time_s")
    worker.fails = False
    assert send(client, track).json()["frame"] == 1


def test_a_frame_that_takes_too_long(client, worker, problem):
    track = client.post("/v1/tracks", json={"timeout_s": 0.2}).json()["id"]
    worker.free.clear()
    response = send(client, track)
    problem(response, 503)
    worker.free.set()
    assert send(client, track).json()["frame"] == 1


def test_two_frames_at_once_are_one_after_the_other(client, track, worker, problem, monkeypatch):
    monkeypatch.setattr(frames, "_WAIT_FOR_OTHERS_S", 0.05)
    worker.free.clear()
    first: list = []
    thread = threading.Thread(target=lambda: first.append(send(client, track)))
    thread.start()
    wait_until(lambda: client.get("/v1/jobs").json()["jobs"], 10.0)
    problem(send(client, track), 409, "track_busy")
    worker.free.set()
    thread.join()
    assert first[0].json()["frame"] == 1


class TestKeys:
    @pytest.fixture
    def guarded(self, service_settings, tmp_path):
        file = tmp_path / "keys.toml"
        file.write_text(
            "\n".join([entry("cell"), entry("other"), entry("reader", scopes=["read"])])
        )
        with TestClient(
            create_app(service_settings.model_copy(update={"api_keys_file": file}))
        ) as client:
            yield client

    def test_only_its_owner_reaches_a_track(self, guarded, worker):
        track = guarded.post("/v1/tracks", headers=as_("cell")).json()["id"]
        assert guarded.get(f"/v1/tracks/{track}", headers=as_("cell")).status_code == 200
        for name in ("other", "reader"):
            assert guarded.get(f"/v1/tracks/{track}", headers=as_(name)).status_code == 404
        assert send(guarded, track, headers=as_("other")).status_code == 404
        assert guarded.delete(f"/v1/tracks/{track}", headers=as_("other")).status_code == 404
        assert send(guarded, track, headers=as_("cell")).status_code == 200

    def test_scopes(self, guarded):
        assert guarded.post("/v1/tracks").status_code == 401
        assert guarded.post("/v1/tracks", headers=as_("reader")).status_code == 403

    @pytest.mark.parametrize("headers", [{}, as_("nobody"), as_("reader"), as_("other")])
    def test_a_stream_is_refused_without_the_right_key(self, guarded, headers):
        track = guarded.post("/v1/tracks", headers=as_("cell")).json()["id"]
        with (
            pytest.raises(WebSocketDisconnect) as refused,
            guarded.websocket_connect(f"/v1/tracks/{track}/stream", headers=headers),
        ):
            pass
        assert refused.value.code == 1008

    def test_a_stream_with_the_right_key(self, guarded, worker):
        track = guarded.post("/v1/tracks", headers=as_("cell")).json()["id"]
        with guarded.websocket_connect(f"/v1/tracks/{track}/stream", headers=as_("cell")) as stream:
            stream.send_bytes(samples.encoded())
            assert stream.receive_json()["frame"] == 1


class TestStream:
    @pytest.fixture
    def stream(self, client, track):
        with client.websocket_connect(f"/v1/tracks/{track}/stream") as stream:
            yield stream

    def test_pictures_and_their_times(self, stream, worker):
        for number in (1, 2):
            stream.send_text(json.dumps({"time_s": 2.0 * number, "number": 7 * number}))
            stream.send_bytes(samples.encoded())
            frame = stream.receive_json()
            assert (frame["frame"], frame["time_s"], frame["dropped"]) == (number, 2.0 * number, 0)
            assert frame["number"] == 7 * number

    def test_old_pictures_are_dropped(self, stream, worker, client):
        """While one is looked at, only the newest of those that come in waits."""
        worker.free.clear()
        stream.send_bytes(samples.encoded())
        wait_until(lambda: client.get("/v1/jobs").json()["jobs"], 10.0)
        pictures = [samples.encoded(samples.pixels(40 + k, 30)) for k in range(5)]
        for picture in pictures:
            stream.send_bytes(picture)
        stream.send_text("no JSON")
        assert (
            stream.receive_json()["problem"]["errors"][0]["field"] == "time_s"
        )  # all were received
        worker.free.set()
        assert stream.receive_json()["dropped"] == 0
        assert stream.receive_json()["dropped"] == 4
        assert len(worker.requests) == 2

    def test_a_bad_picture_does_not_end_the_stream(self, stream, worker):
        stream.send_text(json.dumps({"number": 3}))
        stream.send_bytes(b"this is no picture")
        answer = stream.receive_json()
        problem = answer["problem"]
        assert (problem["status"], problem["errors"][0]["field"], answer["number"]) == (
            422,
            "image",
            3,
        )
        stream.send_bytes(samples.encoded())
        assert stream.receive_json()["frame"] == 1

    def test_a_number_that_is_none_is_named(self, stream, worker):
        stream.send_text(json.dumps({"number": "seven"}))
        assert stream.receive_json()["problem"]["errors"][0]["field"] == "number"

    def test_the_sdk_over_a_real_server(self, address, worker):
        with Client(address) as client, client.track() as track, track.stream() as stream:
            stream.show(samples.encoded(), time_s=1.5)
            (frame,) = stream
            assert (frame.number, frame.frame, frame.time_s, frame.dropped) == (1, 1, 1.5, 0)

    def test_a_track_that_is_ended_ends_its_stream(self, stream, worker, client, track):
        client.delete(f"/v1/tracks/{track}")
        stream.send_bytes(samples.encoded())
        assert stream.receive_json()["problem"]["code"] == "unknown_track"
        with pytest.raises(WebSocketDisconnect):
            stream.receive_json()

    def test_an_unknown_track(self, client):
        with (
            pytest.raises(WebSocketDisconnect) as refused,
            client.websocket_connect(f"/v1/tracks/{UNKNOWN}/stream"),
        ):
            pass
        assert (refused.value.code, refused.value.reason) == (1008, "unknown_track")

    def test_over_a_real_server(self, address, worker):
        """Without a package for WebSockets the server answers 404 to every stream."""
        track = httpx.post(f"{address}/v1/tracks").json()["id"]
        with connect(f"{address.replace('http', 'ws')}/v1/tracks/{track}/stream") as stream:
            stream.send(samples.encoded())
            assert json.loads(stream.recv(timeout=60))["frame"] == 1

    @pytest.mark.parametrize(
        "headers", [{"host": "evil.example"}, {"origin": "http://evil.example"}]
    )
    def test_a_page_from_elsewhere_opens_no_stream(self, client, track, headers):
        """A browser sends no preflight for a WebSocket: the gate has to look at it as at a POST."""
        with (
            pytest.raises(WebSocketDisconnect) as refused,
            client.websocket_connect(f"/v1/tracks/{track}/stream", headers=headers),
        ):
            pass
        assert refused.value.code == 1008
