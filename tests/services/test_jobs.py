"""``/v1/jobs`` of jobs that are there: look, wait, cancel, list, and the files of a result."""

import threading
import time

import pytest
from dlo_client.contracts import AnyJob, FileRef, JobPage, NoopResult

from workers.blobs import FolderBlobs

UNKNOWN = "0" * 32
NOT_IDS = ["x", "0" * 31, "0" * 33, "G" * 32, "..", "*", "%00", "a" * 5000]


@pytest.fixture
def noop(client) -> str:
    """The id of a queued job."""
    return client.post("/v1/jobs", json={"kind": "noop"}).json()["id"]


@pytest.fixture
def finish(ledger):
    """Runs a job as a worker would."""

    def finish(job_id: str, files: tuple[FileRef, ...] = ()) -> None:
        claim = ledger.claim(job_id, "by hand")
        assert ledger.succeed(claim, NoopResult(held_s=0), list(files), {"run": 1.0})

    return finish


class TestRead:
    def test_queued_job(self, client, noop):
        job = AnyJob.model_validate(client.get(f"/v1/jobs/{noop}").json())
        assert (job.id, job.kind, job.state) == (noop, "noop", "queued")

    def test_finished_job_has_its_result(self, client, noop, finish):
        finish(noop)
        job = AnyJob.model_validate(client.get(f"/v1/jobs/{noop}").json())
        assert job.state == "succeeded"
        assert job.result == NoopResult(held_s=0)
        assert job.timings_ms == {"run": 1.0}

    @pytest.mark.parametrize("path", ["", "/events", "/files/overlay.png"])
    @pytest.mark.parametrize("job_id", [UNKNOWN, *NOT_IDS])
    def test_unknown_job(self, client, problem, job_id, path):
        problem(client.get(f"/v1/jobs/{job_id}{path}"), 404)

    def test_expired_job(self, client, problem, noop, job_queue):
        client.delete(f"/v1/jobs/{noop}")
        job_queue._client.delete(f"dlo:job:{noop}")
        for method, path in [("GET", ""), ("GET", "/events"), ("GET", "/files/x"), ("DELETE", "")]:
            problem(client.request(method, f"/v1/jobs/{noop}{path}"), 410, "job_expired")


class TestWait:
    def test_answers_202_when_the_time_is_over(self, client):
        response = client.post("/v1/jobs?wait=0.05", json={"kind": "noop"})
        assert response.status_code == 202
        assert response.json()["state"] == "queued"

    def test_ends_with_the_job(self, client, noop, finish):
        """The worker ends the job while the request waits, far sooner than it may wait."""
        worker = threading.Timer(0.2, finish, [noop])
        worker.start()
        started = time.monotonic()
        job = client.get(f"/v1/jobs/{noop}?wait=60").json()
        assert job["state"] == "succeeded"
        assert time.monotonic() - started < 30
        worker.join()

    def test_progress_does_not_end_it(self, client, noop, ledger):
        claim = ledger.claim(noop, "by hand")
        ledger.progress(claim, 0.5)
        job = client.get(f"/v1/jobs/{noop}?wait=0.1").json()
        assert (job["state"], job["progress"]) == ("running", 0.5)

    def test_finished_job_is_not_waited_for(self, client, noop, finish):
        finish(noop)
        assert client.get(f"/v1/jobs/{noop}?wait=60").json()["state"] == "succeeded"


class TestCancel:
    def test_cancels_and_is_idempotent(self, client, noop):
        for _ in range(2):
            response = client.delete(f"/v1/jobs/{noop}")
            assert response.status_code == 200
            assert response.json()["state"] == "cancelled"

    def test_finished_job_stays_as_it_is(self, client, noop, finish):
        finish(noop)
        assert client.delete(f"/v1/jobs/{noop}").json()["state"] == "succeeded"

    @pytest.mark.parametrize("job_id", [UNKNOWN, *NOT_IDS])
    def test_unknown_job(self, client, problem, job_id):
        problem(client.delete(f"/v1/jobs/{job_id}"), 404)


class TestList:
    def test_pages_newest_first(self, client):
        ids = [client.post("/v1/jobs", json={"kind": "noop"}).json()["id"] for _ in range(5)]
        found, cursor = [], None
        for _ in range(3):
            query = {"limit": 2} | ({"cursor": cursor} if cursor else {})
            page = JobPage.model_validate(client.get("/v1/jobs", params=query).json())
            found += [job.id for job in page.jobs]
            cursor = page.next_cursor
        assert cursor is None
        assert found == ids[::-1]

    def test_filters(self, client, noop):
        client.post("/v1/jobs", json={"kind": "noop"})
        client.delete(f"/v1/jobs/{noop}")
        for query, expected in [
            ({"state": "cancelled"}, 1),
            ({"state": "queued"}, 1),
            ({"kind": "noop"}, 2),
            ({"kind": "segment"}, 0),
        ]:
            assert len(client.get("/v1/jobs", params=query).json()["jobs"]) == expected

    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("limit", "0"),
            ("limit", "201"),
            ("cursor", "last"),
            ("cursor", "1" * 5000),
            ("state", "done"),
            ("kind", "knot"),
        ],
    )
    def test_parameter_at_fault_is_named(self, client, problem, field, value):
        problem(client.get("/v1/jobs", params={field: value}), 422, field=field)


class TestFiles:
    @pytest.fixture
    def overlay(self, settings, noop, finish) -> FileRef:
        data = b"a picture of it"
        digest = FolderBlobs(settings.blobs_dir, 60).put(data)
        file = FileRef(name="overlay.png", media_type="image/png", bytes=len(data), sha256=digest)
        finish(noop, (file,))
        return file

    def test_file_of_a_result(self, client, noop, overlay):
        response = client.get(f"/v1/jobs/{noop}/files/overlay.png")
        assert response.status_code == 200
        assert response.content == b"a picture of it"
        assert response.headers["content-type"] == "image/png"
        assert response.headers["etag"] == f'"{overlay.sha256}"'

    def test_known_file_is_not_sent_again(self, client, noop, overlay):
        url = f"/v1/jobs/{noop}/files/overlay.png"
        response = client.get(url, headers={"If-None-Match": f'W/"{overlay.sha256}"'})
        assert (response.status_code, response.content) == (304, b"")
        assert client.get(url, headers={"If-None-Match": '"other"'}).status_code == 200

    @pytest.mark.parametrize(
        "name",
        ["mask.png", "%2e%2e", "%2e%2e%2f%2e%2e%2fserve.lock", "..%5c..", "overlay.png%00", "*"],
    )
    def test_name_that_is_not_in_the_jobs_list(self, client, problem, noop, overlay, name):
        problem(client.get(f"/v1/jobs/{noop}/files/{name}"), 404)

    def test_blob_itself_is_no_name(self, client, problem, noop, overlay):
        problem(client.get(f"/v1/jobs/{noop}/files/{overlay.sha256}"), 404, "unknown_file")

    def test_file_whose_lifetime_is_over(self, client, problem, settings, noop, overlay):
        FolderBlobs(settings.blobs_dir, 60).path(overlay.sha256).unlink()
        problem(client.get(f"/v1/jobs/{noop}/files/overlay.png"), 410, "file_expired")


class TestFullQueue:
    def test_says_when_to_come_back(self, settings, problem, client, app, job_queue, monkeypatch):
        small = settings.model_copy(update={"max_queue_depth": 1})
        monkeypatch.setattr(app.state.backend.queue, "_settings", small)
        assert client.post("/v1/jobs", json={"kind": "noop"}).status_code == 202
        refused = client.post("/v1/jobs", json={"kind": "noop"})
        problem(refused, 429, "queue_full")
        assert int(refused.headers["Retry-After"]) >= 1
