"""The report of the benchmarks."""

from __future__ import annotations

import json
from pathlib import Path

from tests.benchmarks.report import write_report


def test_what_was_not_measured_again_keeps_its_section(tmp_path: Path) -> None:
    """One benchmark run in a fresh checkout wiped out the figures of all the others."""
    target = tmp_path / "RESULTS.md"
    (tmp_path / "http.json").write_text(json.dumps({"jobs": 300, "p50_ms": 4.5, "p95_ms": 6.0}))
    write_report(tmp_path, target)
    before = target.read_text()
    assert "| 300 | 4.5 | 6.0 |" in before
    (tmp_path / "http.json").unlink()
    write_report(tmp_path, target)
    assert target.read_text() == before
