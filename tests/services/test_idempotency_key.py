"""``Idempotency-Key`` of ``POST /v1/jobs``."""

from tests.services import samples


def test_same_key_and_request_give_the_same_job(client, job_queue):
    first, second = (
        client.post("/v1/jobs", json={"kind": "noop"}, headers={"Idempotency-Key": "k1"})
        for _ in range(2)
    )
    assert first.status_code == second.status_code == 202
    assert first.json()["id"] == second.json()["id"]
    assert job_queue.depth()["interactive"] == 1


def test_same_pictures_sent_anew_are_the_same_request(client):
    def send():
        files = [("image", ("x", samples.encoded())), ("request", (None, '{"kind": "segment"}'))]
        return client.post("/v1/jobs", files=files, headers={"Idempotency-Key": "k2"}).json()["id"]

    assert send() == send()


def test_same_key_for_another_request(client, problem):
    headers = {"Idempotency-Key": "k3"}
    client.post("/v1/jobs", json={"kind": "noop"}, headers=headers)
    other = client.post("/v1/jobs", json={"kind": "noop", "hold_s": 1}, headers=headers)
    problem(other, 409, "idempotency_conflict", "Idempotency-Key")


def test_key_out_of_range(client, problem):
    response = client.post(
        "/v1/jobs", json={"kind": "noop"}, headers={"Idempotency-Key": "k" * 256}
    )
    problem(response, 422, field="Idempotency-Key")
