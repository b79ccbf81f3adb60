"""Ready is said only when the workers see the pictures that the service keeps."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from tests.processes import KEYS, wait_until
from workers import presence
from workers.connection import connect


@pytest.mark.system
def test_a_worker_with_a_folder_of_its_own_does_not_join_and_the_reason_is_told(
    client, job_queue, start_worker, settings, tmp_path
):
    """It took its share of the jobs and failed them with "unknown_image, upload it again"."""
    start_worker(settings.model_copy(update={"data_dir": tmp_path / "elsewhere"}), wait=False)
    detail = wait_until(lambda: _reason(client), 120)
    assert str(tmp_path / "elsewhere") in detail
    assert "DLO_DATA_DIR" in detail
    assert job_queue.workers() == []
    job = client.post("/v1/jobs", json={"kind": "noop"}).json()
    assert client.get(f"/v1/jobs/{job['id']}").json()["state"] == "queued"


def _reason(client) -> str:
    """Why the service is not ready, once a worker has said why it does not join."""
    detail = client.get("/readyz").json()["detail"]
    return detail if "does not join" in detail else ""


def test_a_service_with_another_folder_than_its_workers_is_not_ready(client, settings, monkeypatch):
    """A second service: pictures that are sent to it would not be found."""
    monkeypatch.setattr(presence, "EXPIRY_MS", 600_000)
    with connect(settings) as queue_server:
        presence.announce(
            queue_server, KEYS, presence.WorkerInfo("w", True, False, [], datetime.now(UTC), [])
        )
        queue_server.set(KEYS.blobs, "mark of the folder that the workers share")
    detail = client.get("/readyz").json()["detail"]
    assert "not the place where the others keep pictures" in detail
