import asyncio
import os
from dataclasses import replace
from datetime import UTC, datetime

import pytest
from dlo_client.contracts import (
    AnyJob,
    ImageRef,
    JobState,
    NoopRequest,
    NoopResult,
    PlanShapeRequest,
    SegmentRequest,
)

from tests.processes import wait_until
from tests.workers.trips import commands_during
from workers.admission import Terms
from workers.blobs import FolderBlobs
from workers.connection import connect
from workers.ledger import Ledger
from workers.listing import trim
from workers.presence import WorkerInfo, announce, depart
from workers.queue import (
    AsyncJobQueue,
    IdempotencyConflict,
    JobGone,
    JobQueue,
    JobUnknown,
    QueueFull,
)
from workers.record import REQUEST, Entry, Origin
from workers.settings import Settings


@pytest.fixture
def ledger(settings):
    with connect(settings) as client:
        yield Ledger(client, settings)


def finish(ledger, job_id):
    ledger.succeed(ledger.claim(job_id, "w"), NoopResult(held_s=0.0), [], {})


def with_settings(settings, **changes):
    return JobQueue(Settings(**settings.model_dump() | changes))


def test_a_submitted_job_waits_in_the_queue_of_its_priority(job_queue):
    job, created = job_queue.submit(NoopRequest(priority="batch", label="night shift"))
    assert created
    assert (job.state, job.kind, job.priority, job.label) == (
        JobState.QUEUED,
        "noop",
        "batch",
        "night shift",
    )
    assert job_queue.get(job.id) == job
    assert job_queue.depth() == {"interactive": 0, "batch": 1, "training": 0}


def test_unknown_job(job_queue):
    for ask in (job_queue.get, job_queue.cancel, job_queue.events):
        with pytest.raises(JobUnknown):
            ask("0" * 32)


def test_a_job_is_gone_after_its_lifetime_and_unknown_after_its_tombstone(settings, ledger):
    queue = with_settings(settings, result_ttl_s=0.2, tombstone_ttl_s=0.5)
    job, _ = queue.submit(NoopRequest())
    assert queue.cancel(job.id).state is JobState.CANCELLED

    def answer():
        try:
            return queue.get(job.id).state
        except (JobGone, JobUnknown) as error:
            return type(error)

    wait_until(lambda: answer() is JobGone)
    wait_until(lambda: answer() is JobUnknown)


def test_full(settings):
    queue = with_settings(settings, max_queue_depth=2)
    queue.submit(NoopRequest())
    queue.submit(NoopRequest(priority="batch"))
    with pytest.raises(QueueFull) as error:
        queue.submit(NoopRequest())
    assert error.value.retry_after_s > 0


def test_the_same_key_and_request_is_the_same_job_even_when_full(settings):
    queue = with_settings(settings, max_queue_depth=1)
    first, created = queue.submit(NoopRequest(), idempotency_key="k", request_digest="d1")
    again, created_again = queue.submit(NoopRequest(), idempotency_key="k", request_digest="d1")
    assert (created, created_again, again) == (True, False, first)
    assert queue.depth()["interactive"] == 1


def test_the_same_key_and_another_request_is_a_conflict(job_queue):
    job_queue.submit(NoopRequest(), idempotency_key="k", request_digest="d1")
    with pytest.raises(IdempotencyConflict):
        job_queue.submit(NoopRequest(), idempotency_key="k", request_digest="d2")
    _, created = job_queue.submit(NoopRequest(), idempotency_key="other", request_digest="d2")
    assert created


def test_a_key_may_be_used_again_after_its_lifetime(settings):
    queue = with_settings(settings, idempotency_ttl_s=0.1)
    queue.submit(NoopRequest(), idempotency_key="k", request_digest="d1")

    def created():
        return queue.submit(NoopRequest(), idempotency_key="k", request_digest="d1")[1]

    assert wait_until(created)


def test_submitting_touches_the_pictures(job_queue, settings):
    blobs = FolderBlobs(settings.blobs_dir, settings.blob_ttl_s)
    blob_id = blobs.put(b"picture")
    os.utime(blobs.path(blob_id), (0, 0))
    job_queue.submit(SegmentRequest(image=ImageRef(id=blob_id)))
    assert blobs.sweep() == 0


def test_events_tell_the_whole_story_and_resume(job_queue, ledger):
    job, _ = job_queue.submit(NoopRequest())
    claim = ledger.claim(job.id, "w")
    ledger.progress(claim, 0.5)
    ledger.succeed(claim, NoopResult(held_s=0.0), [], {})
    events = job_queue.events(job.id)
    assert [(event.state.value, event.progress) for event in events] == [
        ("queued", 0.0),
        ("running", 0.0),
        ("running", 0.5),
        ("succeeded", 1.0),
    ]
    assert job_queue.events(job.id, events[1].id) == events[2:]
    assert job_queue.events(job.id, "not an id") == events
    for block_ms in (20, 0, -1):
        assert job_queue.events(job.id, events[-1].id, block_ms) == []


def test_async_twin_waits_for_events(settings, job_queue):
    async def watch(job_id):
        queue = AsyncJobQueue(settings)
        try:
            [queued] = await queue.events(job_id)
            waiting = asyncio.create_task(queue.events(job_id, queued.id, block_ms=5000))
            await asyncio.to_thread(job_queue.cancel, job_id)
            [cancelled] = await waiting
            with pytest.raises(JobUnknown):
                await queue.get("0" * 32)
            return cancelled, await queue.get(job_id)
        finally:
            await queue.close()

    job, _ = job_queue.submit(NoopRequest())
    event, seen = asyncio.run(watch(job.id))
    assert event.state is JobState.CANCELLED
    assert AnyJob.model_validate_json(seen.json()) == job_queue.get(job.id)


def test_recent_pages_newest_first(job_queue):
    ids = [job_queue.submit(NoopRequest())[0].id for _ in range(5)]
    first = job_queue.recent(limit=2)
    assert [job.id for job in first.jobs] == [ids[4], ids[3]]
    job_queue.submit(NoopRequest())  # does not shift the next page
    second = job_queue.recent(limit=2, cursor=first.next_cursor)
    assert [job.id for job in second.jobs] == [ids[2], ids[1]]
    last = job_queue.recent(limit=2, cursor=second.next_cursor)
    assert [job.id for job in last.jobs] == [ids[0]]
    assert last.next_cursor is None


def test_recent_filters_and_leaves_results_out(job_queue, ledger):
    done = job_queue.submit(NoopRequest())[0].id
    waiting = job_queue.submit(NoopRequest())[0].id
    finish(ledger, done)
    [job] = job_queue.recent(state=JobState.SUCCEEDED).jobs
    assert (job.id, job.result) == (done, None)
    assert [job.id for job in job_queue.recent(state=JobState.QUEUED).jobs] == [waiting]
    assert job_queue.recent(kind="segment").jobs == []


def test_recent_refuses_a_foreign_cursor(job_queue):
    with pytest.raises(ValueError, match="cursor"):
        job_queue.recent(cursor="; DROP")


def test_recent_forgets_expired_jobs(settings):
    queue = with_settings(settings, result_ttl_s=0.05)
    expired = queue.submit(NoopRequest())[0].id
    queue.cancel(expired)
    kept = queue.submit(NoopRequest())[0].id
    with connect(settings) as client:
        wait_until(lambda: trim(client, settings.keys) == 1)
        assert client.zrange("dlo:recent", 0, -1) == [kept]
    assert [job.id for job in queue.recent().jobs] == [kept]


def test_workers_announce_themselves_and_depart(job_queue, settings):
    started_at = datetime(2026, 11, 23, tzinfo=UTC)
    info = WorkerInfo(
        "w1", ready=True, busy=False, queues=["batch"], started_at=started_at, networks=[]
    )
    with connect(settings) as client:
        announce(client, settings.keys, info)
        assert job_queue.workers() == [info]
        client.delete("dlo:worker:w1")  # as by expiry
        assert job_queue.workers() == []
        announce(client, settings.keys, info)
        depart(client, settings.keys, "w1")
    assert job_queue.workers() == []


def test_ping(job_queue, settings):
    assert job_queue.ping()
    assert not with_settings(settings, redis_url="redis://127.0.0.1:1/0").ping()


def test_a_submission_is_one_trip_to_the_queue_server(settings, job_queue):
    """It was five, and a no-op took 9 ms."""
    entry = Entry.of(NoopRequest())
    for key in ("first", None, "second"):  # the first time the script is loaded
        sent = commands_during(settings, lambda key=key: job_queue.put(entry, idempotency_key=key))
    assert sent["evalsha"] == 1
    assert not {"multi", "exec", "watch", "hgetall", "script|exists"} & sent.keys()
    assert job_queue.depth()["interactive"] == 3


def test_a_submission_that_is_sent_again_is_one_job(settings, ledger, job_queue):
    """The answer was lost on its way: the connection sends the script once more."""
    terms = Terms(max_depth=10, max_bytes=2**40)
    for _ in range(2):
        assert ledger.open(ledger.opening("a" * 32, Entry.of(NoopRequest()), terms)) is None
    with connect(settings) as client:
        assert client.lrange("rq:queue:dlo:interactive", 0, -1) == ["a" * 32]
    assert len(job_queue.recent().jobs) == 1


def test_the_twin_submits_without_a_thread(settings, job_queue):
    """On a busy machine handing each submission to a thread and back took as long as all else about
    it."""

    async def twice(openings):
        queue = AsyncJobQueue(settings)
        try:
            return [await queue.open(opening) for opening in openings]
        finally:
            await queue.close()

    def opening(key=None, digest="", queue=job_queue, **fields):
        entry = Entry.of(NoopRequest(**fields))
        found = queue.opening(
            entry, idempotency_key=key, request_digest=digest, origin=Origin("ann")
        )
        assert found is not None
        return found

    once = opening()
    first, again, other = asyncio.run(twice([once, once, opening(priority="batch")]))
    assert first == again == once.job_id, "its answer was lost on the way"
    assert job_queue.depth() == {"interactive": 1, "batch": 1, "training": 0}
    assert job_queue.get(other).state is JobState.QUEUED
    known = asyncio.run(twice([opening("a", "1"), opening("a", "1")]))
    assert known[0] == known[1]
    with pytest.raises(IdempotencyConflict):
        asyncio.run(twice([opening("a", "2")]))
    with pytest.raises(QueueFull):
        asyncio.run(twice([opening(queue=with_settings(settings, max_queue_depth=1))]))
    assert job_queue.opening(replace(Entry.of(NoopRequest()), request="x" * 40_000)) is None, (
        "it goes into a blob"
    )


def test_everybody_who_waits_for_a_job_gets_its_end(settings, job_queue, ledger):
    async def watch(job_id):
        queue = AsyncJobQueue(settings)
        try:
            assert (await queue.when_ended(job_id, block_ms=10)).job.state is JobState.QUEUED
            waiting = [
                asyncio.create_task(queue.when_ended(job_id, block_ms=60_000)) for _ in range(3)
            ]
            await asyncio.sleep(0.05)
            await asyncio.to_thread(finish, ledger, job_id)
            late = queue.when_ended(job_id, block_ms=60_000)
            with pytest.raises(JobUnknown):
                await queue.when_ended("0" * 32, block_ms=1)
            return await asyncio.wait_for(asyncio.gather(*waiting, late), 50)
        finally:
            await queue.close()

    job, _ = job_queue.submit(NoopRequest())
    records = asyncio.run(watch(job.id))
    assert [record.job.state for record in records] == [JobState.SUCCEEDED] * 4
    assert {record.result for record in records} == {'{"kind":"noop","held_s":0.0}'}


def test_a_large_request_waits_in_a_blob(job_queue, settings, ledger):
    line = [(0.001 * x, 0.0) for x in range(2000)]
    request = PlanShapeRequest(state_m=line, target_m=line, object={"mass_kg": 0.05})
    job, _ = job_queue.submit(request)
    claim = ledger.claim(job.id, "w")
    assert claim.request == ""
    stored = FolderBlobs(settings.blobs_dir, settings.blob_ttl_s).get(claim.request_blob)
    assert REQUEST.validate_json(stored) == request
    with connect(settings) as client:
        assert client.memory_usage(f"dlo:job:{job.id}") < 4096


def test_a_queue_server_that_holds_enough_takes_no_more(settings):
    with pytest.raises(QueueFull, match="holds as much"):
        with_settings(settings, max_queue_bytes=1).submit(NoopRequest())


def test_an_owner_may_have_so_many_jobs_under_way(job_queue, ledger):
    job, _ = job_queue.submit(NoopRequest(), origin=Origin("cell"), most_jobs=1)
    with pytest.raises(QueueFull, match="1 jobs under way"):
        job_queue.submit(NoopRequest(), origin=Origin("cell"), most_jobs=1)
    job_queue.submit(NoopRequest(), origin=Origin("other"), most_jobs=1)
    finish(ledger, job.id)
    job_queue.submit(NoopRequest(), origin=Origin("cell"), most_jobs=1)


def test_two_owners_may_use_the_same_idempotency_key(job_queue):
    made = [
        job_queue.submit(NoopRequest(), idempotency_key="k", origin=Origin(owner))[1]
        for owner in ("a", "b", "a")
    ]
    assert made == [True, True, False]
