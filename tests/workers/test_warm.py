"""RQ's worker as it is used here."""

from __future__ import annotations

from dlo_client.contracts import NoopRequest

from tests.workers.trips import commands_during
from workers.warm import WarmWorker


def test_the_queue_server_is_asked_twice_around_a_job(settings, job_queue, monkeypatch):
    """RQ wrote a dozen times about its worker, before a job began and before the next one could."""
    worker, ran = WarmWorker(settings, "w"), []
    monkeypatch.setattr(worker._runner, "ready", lambda: None)
    monkeypatch.setattr(worker._runner, "run", ran.append)
    ids = [job_queue.submit(NoopRequest())[0].id for _ in range(2)]

    def turn() -> None:  # of RQ's loop
        worker.check_for_suspension(burst=False)
        worker.execute_job(*worker.dequeue_job_and_maintain_ttl(3))
        worker.heartbeat()

    turn()
    assert commands_during(settings, turn) == {"blpop": 1, "hget": 1}
    assert ran == ids


def test_rq_goes_on_knowing_its_worker(settings, monkeypatch, job_queue):
    """It forgets one that says nothing for a minute and a half, and then its jobs would look
    abandoned to its tools."""
    worker = WarmWorker(settings, "w")
    assert "expire" in commands_during(settings, worker.heartbeat)
    assert commands_during(settings, worker.heartbeat) == {}
    monkeypatch.setattr("workers.warm.time.monotonic", lambda: worker._beat + 11.0)
    assert "expire" in commands_during(settings, worker.heartbeat)
