"""Everything that may die does, with real servers and processes: no job is lost, none runs for
ever."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from dlo_client.contracts import JobState, NoopRequest

from tests.processes import KEYS, ROOT, environment, wait_until
from workers import memory
from workers.connection import connect
from workers.embedded import EmbeddedQueue
from workers.queue import JobQueue
from workers.settings import Settings

pytestmark = pytest.mark.system

OUTAGE_S = 2.0
"""Longer than the running job, and than the pause before one attempt to connect again."""


def submit(queue, **fields):
    """A job that may wait for long: what is tested here is not how fast the machine is."""
    return queue.submit(NoopRequest(**{"timeout_s": 1800.0} | fields))[0].id


def wait_for(queue, job_id, *states, timeout_s=300.0):
    """The job, once it is in one of the states."""
    return wait_until(lambda: (job := queue.get(job_id)).state in states and job, timeout_s)


def wait_running(queue, job_id):
    wait_for(queue, job_id, JobState.RUNNING)


def succeeds(queue, job_id, timeout_s=300.0):
    job = wait_for(queue, job_id, JobState.SUCCEEDED, JobState.FAILED, timeout_s=timeout_s)
    assert job.state is JobState.SUCCEEDED, job.problem
    return job


def is_alive(pid):
    return Path(f"/proc/{pid}").exists()


def loaded(*children):
    """Whether each has about as much in memory as the one that has most."""
    sizes = [memory.resident_mb(pid) for pid in children]
    return min(sizes) > 0.9 * max(sizes)


def test_child_killed_in_mid_job_the_job_is_retried(job_queue, start_worker):
    worker = start_worker()
    job_id = submit(job_queue, hold_s=2)
    wait_running(job_queue, job_id)
    os.kill(worker.child_pid(), signal.SIGKILL)
    wait_until(
        lambda: job_queue.get(job_id).attempts == 2 or job_queue.get(job_id).state.final, 300.0
    )
    assert succeeds(job_queue, job_id).attempts == 2
    succeeds(job_queue, submit(job_queue))


def test_child_killed_on_its_last_attempt_the_job_fails(settings, start_worker):
    settings = Settings(**settings.model_dump() | {"max_attempts": 1})
    worker, queue = start_worker(settings), JobQueue(settings)
    job_id = submit(queue, hold_s=30)
    wait_running(queue, job_id)
    os.kill(worker.child_pid(), signal.SIGKILL)
    job = wait_for(queue, job_id, JobState.FAILED, timeout_s=300.0)
    assert job.problem.code == "worker_lost"
    succeeds(queue, submit(queue))


def test_child_killed_while_idle_is_replaced(job_queue, start_worker):
    worker = start_worker()
    first = worker.child_pid()
    os.kill(first, signal.SIGKILL)
    wait_until(lambda: not worker.info().ready)
    worker.wait_ready()
    assert worker.child_pid() != first
    assert succeeds(job_queue, submit(job_queue)).attempts == 1


def test_worker_killed_another_takes_the_job_up(job_queue, start_worker):
    worker = start_worker()
    child = worker.child_pid()
    job_id = submit(job_queue, hold_s=2)
    wait_running(job_queue, job_id)
    worker.kill()
    wait_until(lambda: not is_alive(child))
    start_worker()
    job = succeeds(job_queue, job_id)
    assert job.attempts == 2
    wait_until(lambda: len(job_queue.workers()) == 1)


def test_worker_killed_and_no_other_there_a_service_marks_the_job(settings, start_worker):
    settings = Settings(**settings.model_dump() | {"max_attempts": 1})
    worker, queue = start_worker(settings), JobQueue(settings)
    job_id = submit(queue, hold_s=30)
    wait_running(queue, job_id)
    worker.kill()
    wait_until(lambda: queue.reap() or queue.get(job_id).state.final, 300.0)
    assert queue.get(job_id).problem.code == "worker_lost"


def test_queue_server_killed_queued_jobs_are_still_there(tmp_path, start_worker):
    with EmbeddedQueue(tmp_path / "queue") as server:
        settings = Settings(redis_url=server.url, data_dir=tmp_path)
        queue = JobQueue(settings)
        waiting = [submit(queue, priority=priority) for priority in ("batch", "interactive")]
        server.kill()
        assert not queue.ping()
        server.start()
        assert queue.depth() == {"interactive": 1, "batch": 1, "training": 0}
        worker = start_worker(settings)
        for job_id in waiting:
            succeeds(queue, job_id)
        worker.close()


def test_queue_server_killed_under_a_worker_both_go_on(tmp_path, start_worker):
    """The job that would end while it is away ends well, in its first attempt; the waiting one
    follows."""
    with EmbeddedQueue(tmp_path / "queue") as server:
        settings = Settings(redis_url=server.url, data_dir=tmp_path)
        queue, worker = (
            JobQueue(settings),
            start_worker(Settings(redis_url=server.url, data_dir=tmp_path)),
        )
        running, waiting = submit(queue, hold_s=1), submit(queue)
        wait_running(queue, running)
        server.kill()
        time.sleep(OUTAGE_S)
        server.start()
        assert succeeds(queue, running).attempts == 1
        succeeds(queue, waiting)
        worker.close()


def test_queue_server_killed_under_an_idle_worker(tmp_path, start_worker):
    with EmbeddedQueue(tmp_path / "queue") as server:
        settings = Settings(redis_url=server.url, data_dir=tmp_path)
        worker = start_worker(settings)
        server.kill()
        time.sleep(OUTAGE_S)
        server.start()
        queue = JobQueue(settings)
        succeeds(queue, submit(queue))
        worker.wait_ready()
        server.kill()
        assert worker.stop() == 0, "SIGTERM does not wait for a queue server that is away"


def test_time_limit_kills_the_job_and_the_next_succeeds(job_queue, start_worker):
    worker = start_worker()
    first = worker.child_pid()
    job_id = submit(job_queue, hold_s=60, timeout_s=1)
    job = wait_for(job_queue, job_id, JobState.FAILED, timeout_s=300.0)
    assert job.problem.code == "timed_out"
    assert (job.ended_at - job.created_at).total_seconds() >= 1
    wait_until(lambda: not is_alive(first))
    succeeds(job_queue, submit(job_queue))


def test_cancel_of_a_running_job_kills_it_and_the_next_succeeds(job_queue, start_worker):
    worker = start_worker()
    child = worker.child_pid()
    job_id = submit(job_queue, hold_s=60)
    wait_running(job_queue, job_id)
    assert job_queue.cancel(job_id).state is JobState.CANCELLED
    wait_until(lambda: not is_alive(child), 300.0)
    succeeds(job_queue, submit(job_queue))
    assert job_queue.get(job_id).state is JobState.CANCELLED


def test_a_late_job_never_starts(job_queue, start_worker):
    late = submit(job_queue, timeout_s=0.001)
    in_time = submit(job_queue)
    start_worker()
    succeeds(job_queue, in_time)
    job = job_queue.get(late)
    assert (job.problem.code, job.started_at) == ("deadline_exceeded", None)


def test_interactive_jobs_overtake_batch_jobs(job_queue, start_worker):
    batch = [submit(job_queue, priority="batch") for _ in range(3)]
    interactive = submit(job_queue)
    start_worker()
    for job_id in batch:
        succeeds(job_queue, job_id)
    started = [job_queue.get(job_id).started_at for job_id in (interactive, *batch)]
    assert started == sorted(started)


def test_a_robot_waits_for_one_job_of_a_batch_at_most(job_queue, start_worker):
    """Whatever share batch jobs have of a worker: those that wait do not go before an interactive
    one."""
    batch = [submit(job_queue, priority="batch", hold_s=0.3) for _ in range(100)]
    start_worker()
    wait_for(job_queue, batch[1], JobState.RUNNING, JobState.SUCCEEDED)
    for _ in range(3):
        robot = succeeds(job_queue, submit(job_queue))
        begun = [job.started_at for job_id in batch if (job := job_queue.get(job_id)).started_at]
        assert len(begun) < len(batch), "the batch is not over"
        assert sum(robot.created_at <= start <= robot.started_at for start in begun) <= 1


def test_forged_queue_entries_do_not_run_and_the_worker_lives(
    job_queue, settings, start_worker, tmp_path
):
    """JSON alone is not enough: an entry may name any function of any module."""
    trap = tmp_path / "trap"
    victim = submit(job_queue)
    with connect(settings) as client:
        client.hset(f"rq:job:{victim}", "data", json.dumps(["os.mkdir", None, [str(trap)], {}]))
        client.hset("rq:job:f1", mapping={"data": json.dumps(["os.mkdir", None, [str(trap)], {}])})
        client.hset("rq:job:f2", mapping={"data": b"\x80\x04cos\nsystem\n.", "status": "?"})
        client.set("rq:job:f3", "not a hash")
        client.rpush("rq:queue:dlo:interactive", "f1", "f2", "f3", "f4", "../f5")
        client.sadd("rq:wip:dlo:interactive", "f1")
    worker = start_worker()
    pid = worker.process.pid
    succeeds(job_queue, submit(job_queue))
    assert job_queue.get(victim).problem.code == "refused"
    assert not trap.exists()
    assert worker.process.poll() is None
    assert worker.process.pid == pid


def test_ten_jobs_for_two_workers_none_is_lost(job_queue, start_worker):
    start_worker()
    start_worker()
    jobs = [submit(job_queue, hold_s=0.2) for _ in range(10)]
    ended = [succeeds(job_queue, job_id) for job_id in jobs]
    assert {job.attempts for job in ended} == {1}
    assert job_queue.depth() == {"interactive": 0, "batch": 0, "training": 0}


def test_an_id_that_was_popped_by_a_worker_that_died_comes_back(job_queue, settings, start_worker):
    job_id = submit(job_queue)
    with connect(settings) as client:
        client.lpop("rq:queue:dlo:interactive")
    start_worker()
    assert succeeds(job_queue, job_id).attempts == 1


def test_sigterm_lets_the_job_finish(job_queue, start_worker):
    worker = start_worker()
    child = worker.child_pid()
    running, waiting = submit(job_queue, hold_s=1.5), submit(job_queue)
    wait_running(job_queue, running)
    assert worker.stop() == 0
    job = job_queue.get(running)
    assert (job.state, job.attempts) == (JobState.SUCCEEDED, 1)
    assert job_queue.get(waiting).state is JobState.QUEUED
    wait_until(lambda: not is_alive(child))
    assert job_queue.workers() == []


@pytest.mark.parametrize("worn", [{"recycle_after_jobs": 2}, {"recycle_rss_mb": 1}])
def test_a_worn_child_is_replaced(settings, start_worker, worn):
    settings = Settings(**settings.model_dump() | worn)
    worker, queue = start_worker(settings), JobQueue(settings)
    first = worker.child_pid()
    ended = [succeeds(queue, submit(queue)) for _ in range(3)]
    worker.wait_ready()
    assert worker.child_pid() != first
    assert {job.attempts for job in ended} == {1}, (
        "the job after it was given to a child that had gone"
    )


def test_a_worker_ends_with_its_supervisor(settings):
    program = (
        "import sys\n"
        "from tests.processes import KEYS, WorkerProcess\n"
        "from workers.settings import Settings\n"
        "worker = WorkerProcess(Settings(), 'w')\n"
        "worker.wait_ready()\n"
        "print(worker.process.pid, worker.child_pid(), flush=True)\n"
        "sys.stdin.read()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", program],
        cwd=ROOT,
        env=environment(settings),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as supervisor:
        pids = [int(pid) for pid in supervisor.stdout.readline().split()]
        assert all(is_alive(pid) for pid in pids)
        supervisor.kill()
    wait_until(lambda: not any(is_alive(pid) for pid in pids))


def test_a_child_that_cannot_load_ends_the_worker(settings, tmp_path):
    """So that whoever supervises it sees it, and readiness is never claimed."""
    (tmp_path / "cv2.py").write_text("raise ImportError('broken')")
    broken = environment(settings) | {"PYTHONPATH": str(tmp_path)}
    worker = subprocess.run([sys.executable, "-m", "workers"], cwd=ROOT, env=broken, timeout=300)
    assert worker.returncode == 1


def test_a_finished_record_says_what_it_took(job_queue, settings, start_worker):
    start_worker()
    job = succeeds(job_queue, submit(job_queue, hold_s=0.1, label="seen"))
    assert job.label == "seen"
    assert job.timings_ms["total"] >= 100
    assert job.timings_ms["queue_wait"] >= 0
    with connect(settings) as client:
        assert client.ttl(KEYS.job(job.id)) > 0


def test_the_next_child_is_there_already_when_one_is_killed(settings, start_worker):
    """After a cancel or a kill the worker stopped for the seconds that loading the networks
    takes."""
    settings = Settings(**settings.model_dump() | {"spare_child": True})
    worker, queue = start_worker(settings), JobQueue(settings)
    before = set(wait_until(lambda: len(pids := worker.child_pids()) == 2 and pids))
    job_id = submit(queue, hold_s=30)
    wait_running(queue, job_id)
    queue.cancel(job_id)
    succeeds(queue, submit(queue))
    assert before & set(worker.child_pids()), (
        "the job after it ran in a child that was there before"
    )


def test_a_robot_does_not_wait_for_a_long_job_of_a_batch(settings, start_worker):
    settings = Settings(**settings.model_dump() | {"spare_child": True})
    worker, queue = start_worker(settings), JobQueue(settings)
    wait_until(lambda: len(pids := worker.child_pids()) == 2 and loaded(*pids), 300.0)
    batch = submit(queue, hold_s=12, priority="batch")
    wait_running(queue, batch)
    robots = [succeeds(queue, submit(queue)) for _ in range(2)]
    job = succeeds(queue, batch)
    assert job.attempts == 1
    assert all(
        job.started_at <= robot.started_at <= robot.ended_at < job.ended_at for robot in robots
    )
