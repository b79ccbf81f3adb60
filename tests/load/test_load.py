"""When a rate counts as kept."""

from __future__ import annotations

from dataclasses import replace

import pytest

from tests.faults.traffic import Tally
from tests.load.__main__ import Rate

GOOD = Rate(
    "noop", per_s=10, jobs=100, refused=0, lost=0, failed=0, p50_ms=5, p95_ms=20, worst_ms=90
)


def test_a_rate_is_kept_when_every_job_ends_soon():
    assert GOOD.kept


@pytest.mark.parametrize("change", [{"refused": 1}, {"lost": 1}, {"failed": 1}, {"p95_ms": 1000.0}])
def test_a_rate_is_not_kept_when_one_is_missing_or_they_pile_up(change):
    assert not replace(GOOD, **change).kept


@pytest.mark.parametrize("name", ["lost", "doubled", "wrong", "failed"])
def test_one_job_that_is_not_as_it_should_be_makes_a_scenario_bad(name):
    assert Tally(jobs=10).good
    assert not Tally(jobs=10, **{name: 1}).good
