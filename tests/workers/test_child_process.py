import pytest
from dlo_client.contracts import JobState, NoopRequest

from workers.child_process import ChildDied, ChildProcess
from workers.connection import connect
from workers.ledger import Ledger


@pytest.fixture
def child(settings):
    child = ChildProcess(settings)
    child.start()
    yield child
    child.kill()


def test_a_warm_child_does_jobs_until_it_is_killed(child, job_queue, settings):
    assert child.ready
    with connect(settings) as client:
        ledger = Ledger(client, settings)
        for _ in range(2):
            job, _ = job_queue.submit(NoopRequest())
            claim = ledger.claim(job.id, "w")
            child.give(claim)
            assert child.wait(20)
            child.finish()
            assert job_queue.get(job.id).state is JobState.SUCCEEDED
    child.kill()
    assert (child.ready, child.alive) == (False, False)
    with pytest.raises(ChildDied):
        child.give(claim)


def test_waiting_for_an_idle_child_ends_without_news(child):
    assert not child.wait(0.01)
    assert child.alive
