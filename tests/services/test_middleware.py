"""Around every request: ids, the log, and what nobody caught."""

import re

import pytest
import structlog


def test_request_id_is_echoed_and_logged(client):
    with structlog.testing.capture_logs(
        processors=[structlog.contextvars.merge_contextvars]
    ) as logged:
        response = client.get("/healthz", headers={"X-Request-ID": "cell-3/42"})
    assert response.headers["X-Request-ID"] == "cell-3/42"
    line = next(line for line in logged if line["event"] == "request")
    assert (line["request_id"], line["path"], line["status"]) == ("cell-3/42", "/healthz", 200)


@pytest.mark.parametrize("given", [None, "", "two words", "x" * 129, 'quote"'])
def test_other_request_ids_are_replaced(client, given):
    response = client.get("/healthz", headers={"X-Request-ID": given} if given is not None else {})
    assert re.fullmatch("[0-9a-f]{32}", response.headers["X-Request-ID"])


def test_error_of_ours_carries_an_incident_that_is_in_the_log(client, app, monkeypatch, problem):
    def fail(**_):
        raise RuntimeError("secret of the house")

    monkeypatch.setattr(app.state.backend.queue, "recent", fail)
    with structlog.testing.capture_logs() as logged:
        response = client.get("/v1/jobs", headers={"X-Request-ID": "r1"})
    assert response.headers["X-Request-ID"] == "r1"
    assert "secret" not in response.text
    incident = problem(response, 500, "internal")["incident"]
    assert any(line.get("incident") == incident and line["log_level"] == "error" for line in logged)


@pytest.mark.parametrize("method", ["PUT", "PATCH", "DELETE"])
def test_method_not_allowed(client, problem, method):
    response = client.request(method, "/v1/jobs")
    problem(response, 405, "method_not_allowed")
    assert response.headers["Allow"]


@pytest.mark.parametrize(
    "path", ["/v2/jobs", "/v1", "/viewer/../settings.py", "/viewer/..%2fsettings.py"]
)
def test_no_such_route(client, problem, path):
    problem(client.get(path), 404, "not_found")


def test_the_page_and_its_files(client):
    assert client.get("/").headers["content-type"].startswith("text/html")
    assert client.get("/viewer/index.html").status_code == 200
