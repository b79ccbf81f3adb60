"""The page docs/api.md: each request runs, and its answer has the fields that the page shows."""

from __future__ import annotations

import json
import re
from typing import get_args

import pytest
from dlo_client.contracts import AnyRequest

from tests import api_examples
from workers import stages

OF_UPLOADS = {"adapt", "import_network"}
"""They take uploads that are no pictures: docs/adaptation.md."""
PAGE = api_examples.PAGE.read_text()


def section(title: str) -> str:
    return re.split(r"^## ", PAGE, flags=re.M)[
        1 + [e.title for e in api_examples.examples()].index(title)
    ]


def test_every_kind_has_an_example():
    kinds = {request.model_fields["kind"].default for request in get_args(get_args(AnyRequest)[0])}
    assert {example.kind for example in api_examples.examples()} == kinds - OF_UPLOADS


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    tools = stages.warm(
        api_examples.Settings(data_dir=tmp_path_factory.mktemp("data"), onnx_threads=1)
    )
    return {
        example.title: (result, files) for example, result, files in api_examples.answers(tools)
    }


@pytest.mark.parametrize("example", api_examples.examples(), ids=lambda e: e.title)
def test_the_page_shows_what_is_answered(example, answers):
    """If this fails the API has changed: `python -m tests.api_examples` writes the page anew."""
    result, files = answers[example.title]
    shown = section(example.title)
    assert api_examples.command(example) in shown
    answer = json.loads(re.findall(r"```\n(\{.*?\})\n```", shown, re.S)[-1])
    assert api_examples.outline(answer) == api_examples.outline(api_examples.shortened(result))
    assert all(f"`{name}`" in shown for name in files)
