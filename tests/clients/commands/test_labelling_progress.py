"""Without a terminal `dlo label` printed nothing until it ended."""

from __future__ import annotations

import pytest
from dlo_client.commands.labelling_progress import Lines, shown_progress


def test_lines_come_now_and_then() -> None:
    printed: list[str] = []
    times = iter([0.0, 5.0, 15.0, 16.0, 29.0, 30.0, 31.0])
    lines = Lines(printed.append, every_s=15.0, clock=lambda: next(times))
    for done in (1, 2, 31, 32, 33, 61, 100):
        lines(done, 1, 100)
    assert printed == [
        "labelling: 1 of 100 pictures, 1 failed",
        "labelling: 31 of 100 pictures, 1 failed, 2.0 a second",
        "labelling: 61 of 100 pictures, 1 failed, 2.0 a second",
        "labelling: 100 of 100 pictures, 1 failed, 3.2 a second",
    ]


def test_what_was_done_before_does_not_count_for_the_rate() -> None:
    printed: list[str] = []
    times = iter([0.0, 20.0])
    lines = Lines(printed.append, clock=lambda: next(times))
    lines(1000, 0, 2000)
    lines(1010, 0, 2000)
    assert printed[1].endswith("0.5 a second")


def test_a_log_gets_lines_and_no_bar(capsys: pytest.CaptureFixture[str]) -> None:
    with shown_progress() as progress:
        progress(1, 0, 2)
        progress(2, 1, 2)
    assert capsys.readouterr().err.splitlines()[0] == "labelling: 1 of 2 pictures, 0 failed"
    assert "\x1b" not in capsys.readouterr().err
