"""In which order waiting jobs are taken, and that RQ can be replaced."""

from __future__ import annotations

from dlo_client.contracts import JobState, NoopRequest, NoopResult

from tests.processes import KEYS
from workers.ledger import Ledger
from workers.lua import filled
from workers.queue import JobQueue
from workers.record import Origin
from workers.turns import Turns


def submit(queue, owner="", count=1, **fields):
    return [queue.submit(NoopRequest(**fields), origin=Origin(owner))[0].id for _ in range(count)]


def line(client):
    return client.lrange("rq:queue:dlo:interactive", 0, -1)


def take(client, ledger):
    """As RQ and a worker do; the claim of the job in front."""
    return ledger.claim(client.lpop("rq:queue:dlo:interactive"), "w")


def test_an_owner_with_many_jobs_delays_another_by_one(job_queue, client):
    """A key that sent a thousand jobs made everybody else wait for all of them."""
    many = submit(job_queue, "many", 4)
    few = submit(job_queue, "few", 2)
    assert line(client) == [many[0], few[0], many[1], few[1], many[2], many[3]]


def test_who_comes_late_is_owed_nothing_for_the_time_before(job_queue, client, settings):
    ledger = Ledger(client, settings)
    many = submit(job_queue, "many", 6)
    for _ in range(3):
        take(client, ledger)
    late = submit(job_queue, "late", 3)
    assert line(client) == [many[3], late[0], many[4], late[1], many[5], late[2]]


def test_one_owner_is_served_in_order_and_an_empty_queue_forgets(job_queue, client, settings):
    ledger = Ledger(client, settings)
    jobs = submit(job_queue, "a", 3)
    assert [take(client, ledger).job_id for _ in jobs] == jobs
    a, b = submit(job_queue, "a")[0], submit(job_queue, "b")[0]
    assert line(client) == [a, b]
    assert client.zcard(KEYS.turns("interactive")) == 2


def test_a_job_that_comes_back_goes_first(job_queue, client, settings):
    ledger = Ledger(client, settings)
    jobs = submit(job_queue, "a", 3)
    claim = take(client, ledger)
    assert ledger.lost(claim) == "requeued"
    new = submit(job_queue, "b")
    assert line(client) == [jobs[0], jobs[1], *new, jobs[2]]


def test_cancelled_jobs_leave_no_turn_behind(job_queue, client):
    for job_id in submit(job_queue, "a", 3):
        job_queue.cancel(job_id)
    assert line(client) == []
    assert client.zcard(KEYS.turns("interactive")) == 0
    assert job_queue.depth() == {"interactive": 0, "batch": 0, "training": 0}


def test_batch_has_its_share_while_interactive_jobs_wait():
    """It had none as long as a single interactive job waited."""
    turns, taken = Turns(0.1), []
    for _ in range(100):
        batch = turns.batch_first
        turns.taken(batch=batch)
        taken.append(batch)
    assert sum(taken) == 10
    assert not any(taken[k] and taken[k + 1] for k in range(99)), "never two in a row"


def test_without_a_share_interactive_always_goes_first():
    turns = Turns(0.0)
    for _ in range(1000):
        turns.taken(batch=False)
    assert not turns.batch_first


class ListDispatch:
    """An engine of its own: one plain list for all priorities, without RQ."""

    script = filled(
        """
local function put(first) redis.call('RPUSH', '@line@', ARGV[first]) end
local function take() end
local function withdraw() redis.call('LREM', '@line@', 0, id) end
local function put_back() redis.call('LPUSH', '@line@', id) end
local function has_place() return redis.call('LPOS', '@line@', id) end
""",
        line="other:line",
    )

    def arguments(self, job_id, priority):
        return [job_id]


def test_another_engine_can_take_its_place(settings, client):
    queue, ledger = JobQueue(settings, ListDispatch()), Ledger(client, settings, ListDispatch())
    first, second, third = submit(queue, count=3)
    assert client.keys("rq:*") == []
    queue.cancel(third)
    assert client.lrange("other:line", 0, -1) == [first, second]
    assert ledger.lost(ledger.claim(client.lpop("other:line"), "w")) == "requeued"
    assert client.lpop("other:line") == first
    ledger.succeed(ledger.claim(first, "w"), NoopResult(held_s=0.0), [], {})
    assert queue.get(first).state is JobState.SUCCEEDED
    assert client.lpop("other:line") == second
    assert ledger.reap(second) is None, "it may be on its way to a worker"
    queue.close()


def test_two_deployments_on_one_server_do_not_meet(job_queue, settings, client):
    other_settings = settings.model_copy(update={"queue_prefix": "north"})
    other = JobQueue(other_settings)
    ours, theirs = submit(job_queue)[0], submit(other)[0]
    assert [job.id for job in job_queue.recent().jobs] == [ours]
    assert [job.id for job in other.recent().jobs] == [theirs]
    assert Ledger(client, other_settings).claim(ours, "w") is None
    assert client.lrange("rq:queue:north:interactive", 0, -1) == [theirs]
    assert job_queue.depth() == other.depth() == {"interactive": 1, "batch": 0, "training": 0}
    own = {name for name in client.keys("*") if not name.startswith("rq:")}
    assert all(name.startswith(("dlo:", "north:")) for name in own)
    other.close()
