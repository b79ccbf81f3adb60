"""The benchmarks' command lines: each is a module that loads, with the options that ``make bench``
gives it."""

from pathlib import Path

import pytest

from tests.benchmarks.__main__ import commands, trainings


@pytest.mark.parametrize("name", [*commands(Path()), *trainings(Path())])
def test_every_benchmark_loads(name: str) -> None:
    pytest.importorskip("torch")
    module, *_ = (commands(Path()) | trainings(Path()))[name]
    assert callable(__import__(module, fromlist=["main"]).main)
