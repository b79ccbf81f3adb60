"""Pieces of a long run add up, and every scenario can be asked for."""

from __future__ import annotations

from tests.faults.__main__ import SCENARIOS
from tests.faults.traffic import Tally, added


def row(**fields) -> dict:
    tally = Tally(**fields)
    return {"good": tally.good, **tally.row(), "took_s": 2.5, "load": 1.0}


def test_counts_of_two_runs_add_up_and_the_worst_times_stay():
    both = added(
        row(jobs=200, faults=10, worst_recovery_s=3.0),
        row(jobs=100, faults=5, lost=1, worst_recovery_s=2.0),
    )
    assert (both["jobs"], both["faults"], both["lost"], both["took_s"]) == (300, 15, 1, 5.0)
    assert (both["good"], both["worst_recovery_s"]) == (False, 3.0)


def test_the_worst_time_of_each_part_stays():
    first, second = (
        row(recovery_s={"child": 0.2, "api": 3.0}),
        row(recovery_s={"child": 0.4, "api": 1.0}),
    )
    assert added(first, second)["recovery_s"] == {"child": 0.4, "api": 3.0}
    del first["recovery_s"]
    assert added(first, second)["recovery_s"] == {"child": 0.4, "api": 1.0}, (
        "an older report has none"
    )


def test_a_run_that_was_skipped_does_not_hide_one_that_was_not():
    skipped = {"good": True, "note": "skipped: cannot mount"}
    assert added(row(jobs=10), skipped)["jobs"] == 10
    assert added(skipped, row(jobs=10))["jobs"] == 10


def test_every_scenario_is_explained():
    assert len(SCENARIOS) >= 15
    assert all(scenario.__doc__ for scenario in SCENARIOS.values())
