"""The report of the benchmarks."""

from __future__ import annotations

import json
from pathlib import Path

from tests.benchmarks.report import write_report


def test_what_was_not_measured_again_keeps_its_section(tmp_path: Path) -> None:
    """One benchmark run in a fresh checkout wiped out the figures of all the others."""
    target = tmp_path / "RESULTS.md"
    part = {"jobs": 300, "p50_ms": 4.5, "p95_ms": 6.0}
    (tmp_path / "http.json").write_text(json.dumps({"noop": part, "instances": part}))
    write_report(tmp_path, target)
    before = target.read_text()
    assert "| 300 | 4.5 | 6.0 |" in before
    (tmp_path / "http.json").unlink()
    write_report(tmp_path, target)
    assert target.read_text() == before


def test_what_a_plant_asks_for_is_reported_with_its_figures(tmp_path: Path) -> None:
    found = {
        "throughput": {
            "throughput": {
                "jobs": 240,
                "processes": 2,
                "bare_per_s": 20.0,
                "service_per_s": 19.2,
                "percent": 96.1,
                "rounds_percent": [95.0, 96.1],
            },
            "memory": {
                "limit_mb": 1000,
                "cases": {"at rest": {"api": 120.4, "worker 0": 400.2, "answered": ""}},
            },
        },
        "hosts": {
            "spread": {"jobs": 12, "bad": 0, "taken up again": 0, "s": 9.5},
            "rate": {"jobs": 100, "one": 8.0, "two": 15.0, "ratio": 1.88, "bad": 0},
            "timed": {"jobs": 90, "wait_ms": 150, "one": 6.5, "two": 12.9, "ratio": 1.98, "bad": 0},
        },
        "fuzz": {"parts": {"pictures": {"refused 422": 90, "succeeded": 10}}, "seeds": [1, 2]},
    }
    for name, data in found.items():
        (tmp_path / f"{name}.json").write_text(json.dumps(data))
    write_report(tmp_path, tmp_path / "RESULTS.md")
    report = (tmp_path / "RESULTS.md").read_text()
    for part in (
        "| 2 | 20.0 | 19.2 | 96.1 |",
        "| at rest | 120 | 400 |  |",
        "| spread | 12 | 0 |",
        "| 100 | 8.0 | 15.0 | 1.88 |",
        "a wait of 150 ms",
        "| pictures | 100 | 0 | refused 422 90, succeeded 10 |",
    ):
        assert part in report


def test_hard_tasks_are_pooled_with_the_margin_in_points(tmp_path: Path) -> None:
    found = {
        "deep S, M, loop": {"tasks": 18, "default": 14, "rule": 11},
        "behind pegs": {"tasks": 2, "default": 2, "rule": 0},
    }
    (tmp_path / "hard.json").write_text(json.dumps(found))
    write_report(tmp_path, tmp_path / "RESULTS.md")
    report = (tmp_path / "RESULTS.md").read_text()
    assert "| all | 20 | 16 (80 %) | 11 (55 %) |" in report
    assert "over the rule: 25 points" in report
