"""``/v1/webhooks``."""

from workers.dead_letters import DeadLetters


def test_an_operator_sees_what_was_given_up_and_sends_it_again(client, job_queue, problem):
    letters = DeadLetters(job_queue._client, job_queue._keys)
    letters.bury("a" * 32, "http://cell/", "{}", "answered 500")
    (letter,) = client.get("/v1/webhooks/dead").json()
    assert (letter["job_id"], letter["url"], letter["error"]) == (
        "a" * 32,
        "http://cell/",
        "answered 500",
    )
    assert client.post(f"/v1/webhooks/dead/{letter['job_id']}/resend").status_code == 202
    assert job_queue._client.zscore("dlo:webhooks", letter["job_id"]) == 0
    problem(client.post(f"/v1/webhooks/dead/{'b' * 32}/resend"), 404, "unknown_webhook")
