"""Tests that may not be skipped: with ``DLO_TESTS_NEED="browser firefox"`` a skipped test of these
marks fails.

Continuous integration sets it: a run that passes because its tests did not run proves nothing.
"""

from __future__ import annotations

import os
from collections.abc import Generator

import pytest

VARIABLE = "DLO_TESTS_NEED"


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    needed = os.environ.get(VARIABLE, "").split()
    if report.skipped and any(item.get_closest_marker(name) for name in needed):
        reason = report.longrepr[-1] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"may not be skipped where {VARIABLE}={' '.join(needed)}: {reason}"
    return report
