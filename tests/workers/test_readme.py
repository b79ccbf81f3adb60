"""The top of README.md: what it shows is what the service answers."""

from __future__ import annotations

import json
from typing import Any

import pytest

from tests import readme
from workers import stages
from workers.settings import Settings

_TOLERANCE = 0.05
"""Of a number: processors round differently."""


def _compare(shown: Any, found: Any) -> None:
    if isinstance(found, dict):
        assert list(shown) == list(found)
        for name, value in found.items():
            _compare(shown[name], value)
    elif isinstance(found, list):
        assert len(shown) == len(found)
        for one, other in zip(shown, found, strict=True):
            _compare(one, other)
    elif isinstance(found, float):
        assert shown == pytest.approx(found, rel=_TOLERANCE)
    else:
        assert shown == found


def test_the_answer_in_the_readme_is_what_the_service_answers(tmp_path):
    """If this fails, `python -m tests.readme` makes the picture and the answer anew."""
    tools = stages.warm(Settings(data_dir=tmp_path, onnx_threads=1))
    result, _ = readme.answer(tools)
    _compare(json.loads(readme.shown()), json.loads(readme.block(result)))
