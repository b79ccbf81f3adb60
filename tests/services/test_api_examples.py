"""The requests of docs/api.md are taken by the service as they are sent there."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests import api_examples


@pytest.mark.parametrize("example", api_examples.examples(), ids=lambda e: e.kind)
def test_the_documented_request_is_taken(client, example):
    parts = [("request", (None, json.dumps(example.request), "application/json"))]
    parts += [
        ("image", (Path(name).name, (api_examples.ROOT / name).read_bytes()))
        for name in example.images
    ]
    if example.mask is not None:
        parts.append(("mask", ("mask.png", (api_examples.ROOT / example.mask).read_bytes())))
    reply = client.post("/v1/jobs", files=parts)
    assert reply.status_code == 202, reply.text
    assert reply.json()["kind"] == example.kind
