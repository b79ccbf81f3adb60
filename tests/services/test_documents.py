"""The OpenAPI document says what the service does, and the service does what the document says."""

import re
from datetime import UTC, datetime
from typing import get_args

import pytest
import schemathesis
from dlo_client.contracts import JobKind
from hypothesis import HealthCheck, given, settings
from schemathesis.specs.openapi.checks import response_schema_conformance, status_code_conformance

from workers.presence import WorkerInfo, announce


def test_the_document_is_served(client, document):
    assert client.get("/openapi.json").json() == document


def test_every_answer_but_a_good_one_is_a_problem(document):
    for path, methods in document["paths"].items():
        for method, operation in methods.items():
            for status, response in operation["responses"].items():
                if int(status) >= 400:
                    assert list(response["content"]) == ["application/problem+json"], (
                        path,
                        method,
                        status,
                    )


def test_bodies_are_described(document):
    submit = document["paths"]["/v1/jobs"]["post"]["requestBody"]["content"]
    assert submit["application/json"]["schema"] == {"$ref": "#/components/schemas/AnyRequest"}
    assert set(submit["multipart/form-data"]["schema"]["properties"]) == {
        "request",
        "image",
        "mask",
        "depth",
    }
    kinds = document["components"]["schemas"]["AnyRequest"]["discriminator"]["mapping"]
    assert set(kinds) == set(get_args(JobKind))


def test_every_reference_leads_somewhere(document):
    def references(node):
        if isinstance(node, dict):
            yield from ([node["$ref"]] if isinstance(node.get("$ref"), str) else [])
            for inner in node.values():
                yield from references(inner)
        elif isinstance(node, list):
            for inner in node:
                yield from references(inner)

    schemas = document["components"]["schemas"]
    for reference in references(document):
        assert reference.removeprefix("#/components/schemas/") in schemas
    assert "Job" in schemas
    assert all(len(name) < 40 for name in schemas)


def test_every_field_and_parameter_is_described(document):
    """Three of five fields were bare names."""
    bare = [
        f"{name}.{field}"
        for name, schema in document["components"]["schemas"].items()
        for field, shape in schema.get("properties", {}).items()
        if not shape.get("description")
    ]
    bare += [
        f"{method} {path} {parameter['name']}"
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
        for parameter in operation.get("parameters", [])
        if not parameter.get("description")
    ]
    assert bare == []


@pytest.mark.parametrize("kind", get_args(JobKind))
def test_the_example_of_a_kind_is_taken_as_it_stands(client, document, kind, job_queue):
    """The documentation page offered a body without a ``kind``, which was refused."""
    trainer = WorkerInfo(
        "t", ready=True, busy=False, queues=["training"], started_at=datetime.now(UTC), networks=[]
    )
    announce(job_queue._client, job_queue._keys, trainer)
    examples = document["paths"]["/v1/jobs"]["post"]["requestBody"]["content"]["application/json"][
        "examples"
    ]
    answer = client.post("/v1/jobs", json=examples[kind]["value"])
    assert answer.status_code == 202, answer.text
    assert answer.json()["kind"] == kind


@pytest.mark.parametrize("page", ["/docs", "/redoc"])
def test_documentation_pages_name_no_other_server(client, page):
    text = client.get(page).text
    assert "http://" not in text
    assert "https://" not in text
    scripts = re.findall(r'(?:src|href)="([^"]+)"', text)
    assert len(scripts) >= 2
    for script in scripts:
        assert client.get(script).status_code == 200, script


@pytest.mark.slow
def test_whatever_is_sent_the_document_holds(address):
    """Generated requests, good and bad, to every operation; waiting is cut short, streams are left
    out."""
    schema = schemathesis.openapi.from_url(f"{address}/openapi.json").exclude(path_regex="/events$")
    for operation in schema.get_all_operations():

        @settings(
            max_examples=10,
            deadline=None,
            derandomize=True,
            suppress_health_check=list(HealthCheck),
        )
        @given(operation.ok().as_strategy())
        def conforms(case):
            if case.query and "wait" in case.query:
                case.query["wait"] = "0"
            response = case.call()
            assert response.status_code != 500
            case.validate_response(
                response, checks=[status_code_conformance, response_schema_conformance]
            )

        conforms()
