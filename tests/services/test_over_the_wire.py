"""What only a real HTTP server shows: bodies that are refused half-way, and many who wait at
once."""

import asyncio

import httpx
import pytest
from dlo_client.contracts import NoopResult

from tests.services import samples

pytestmark = pytest.mark.system
MEBIBYTE = 1024 * 1024


def chunks(total: int):
    for _ in range(total // MEBIBYTE):
        yield bytes(MEBIBYTE)


@pytest.mark.parametrize("announced", [True, False])
def test_sender_of_too_much_gets_the_answer_and_the_service_goes_on(address, announced):
    """The answer comes while the sender is still sending; it has to arrive all the same."""
    body = bytes(64 * MEBIBYTE) if announced else chunks(64 * MEBIBYTE)
    with httpx.Client(base_url=address, timeout=60) as client:
        response = client.post("/v1/images", content=body)
        assert (response.status_code, response.json()["errors"][0]["field"]) == (413, "image")
        assert client.post("/v1/images", content=samples.encoded()).status_code == 201


def test_hundreds_may_wait_for_one_job(address, ledger):
    """More than there are threads; meanwhile others are answered."""

    async def scenario() -> list[str]:
        limits = httpx.Limits(max_connections=None)
        async with httpx.AsyncClient(base_url=address, timeout=60, limits=limits) as client:
            job_id = (await client.post("/v1/jobs", json={"kind": "noop"})).json()["id"]
            waiting = [
                asyncio.create_task(client.get(f"/v1/jobs/{job_id}?wait=60")) for _ in range(200)
            ]
            await asyncio.wait(waiting, timeout=1, return_when=asyncio.FIRST_COMPLETED)
            assert (await client.get("/v1/jobs")).status_code == 200
            claim = await asyncio.to_thread(ledger.claim, job_id, "by hand")
            await asyncio.to_thread(ledger.succeed, claim, NoopResult(held_s=0), [], {})
            return [(await answer).json()["state"] for answer in waiting]

    assert asyncio.run(scenario()) == ["succeeded"] * 200


def test_events_arrive_as_they_happen(address, ledger):
    """The first is read while the job is still queued."""
    with httpx.Client(base_url=address, timeout=60) as client:
        job_id = client.post("/v1/jobs", json={"kind": "noop"}).json()["id"]
        with client.stream("GET", f"/v1/jobs/{job_id}/events") as response:
            lines = (line for line in response.iter_lines() if line.startswith("data: "))
            assert '"queued"' in next(lines)
            claim = ledger.claim(job_id, "by hand")
            assert '"running"' in next(lines)
            ledger.succeed(claim, NoopResult(held_s=0), [], {})
            assert '"succeeded"' in next(lines)
            assert next(lines, None) is None


def test_job_of_a_real_worker(address, start_worker):
    start_worker()
    with httpx.Client(base_url=address, timeout=90) as client:
        assert client.get("/readyz").status_code == 200
        answer = client.post("/v1/jobs?wait=60", json={"kind": "noop"})
    assert answer.status_code == 200
    assert answer.json()["result"] == {"kind": "noop", "held_s": 0}
