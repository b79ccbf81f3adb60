import json

import pytest
from dlo_client.contracts import NoopRequest
from rq.exceptions import NoSuchJobError
from rq.serializers import JSONSerializer

from workers.allowed import AllowedJob
from workers.connection import connect


@pytest.fixture
def client(settings):
    with connect(settings, text=False) as client:
        yield client


def fetch(client, job_id):
    return AllowedJob.fetch(job_id, connection=client, serializer=JSONSerializer)


def test_a_submitted_job_is_allowed(job_queue, client):
    job, _ = job_queue.submit(NoopRequest())
    assert fetch(client, job.id).refusal is None


@pytest.mark.parametrize(
    "data",
    [
        json.dumps(["os.system", None, ["id"], {}]),
        json.dumps(["workers.jobs.run", "builtins.object", ["forged"], {}]),
        json.dumps(["workers.jobs.run", None, ["another"], {}]),
        json.dumps(["workers.jobs.run", None, ["forged"], {"ledger": 1}]),
        json.dumps(["workers.jobs.run"]),
        json.dumps(None),
        b"\x80\x04cos\nsystem\n(S'id'\ntR.",
    ],
)
def test_every_other_entry_is_refused(client, data):
    client.hset("rq:job:forged", mapping={"data": data, "status": "queued"})
    assert fetch(client, "forged").refusal


def test_an_entry_that_cannot_be_read_is_refused(client):
    client.hset(
        "rq:job:forged", mapping={"data": "[]", "created_at": "yesterday", "status": "no such"}
    )
    assert fetch(client, "forged").refusal


def test_what_is_no_entry_is_passed_over(client):
    client.set("rq:job:text", "not a hash")
    for job_id in ("missing", "text", "a b/../c"):
        with pytest.raises(NoSuchJobError):
            fetch(client, job_id)
