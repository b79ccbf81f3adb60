"""How far ``dlo label`` is, on the error stream: a bar on a terminal, elsewhere a line now and
then."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

LINE_EVERY_S = 15.0


@contextmanager
def shown_progress() -> Iterator[Callable[[int, int, int], None]]:
    """To be called with how many pictures are done, how many of these failed, and how many there
    are."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield Lines(lambda line: console.print(line, markup=False, highlight=False, soft_wrap=True))
        return
    columns = [
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(elapsed_when_finished=True),
    ]
    with Progress(*columns, console=console) as bar:
        yield _Bar(bar)


class Lines:
    """A line for the first picture, for the last, and between them one every ``every_s``."""

    def __init__(
        self,
        print_line: Callable[[str], None],
        every_s: float = LINE_EVERY_S,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._print, self._every_s, self._clock = print_line, every_s, clock
        self._started: tuple[float, int] | None = None
        self._next = 0.0

    def __call__(self, done: int, failed: int, total: int) -> None:
        now = self._clock()
        if self._started is None:
            self._started, self._next = (now, done), now
        if now < self._next and done < total:
            return
        self._next = now + self._every_s
        since, before = self._started
        rate = (
            f", {(done - before) / (now - since):.1f} a second"
            if done > before and now > since
            else ""
        )
        self._print(f"labelling: {done} of {total} pictures, {failed} failed{rate}")


class _Bar:
    """A bar with rate and time left; what was done before the run does not count for the rate."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("labelling", total=None, rate="")

    def __call__(self, done: int, failed: int, total: int) -> None:
        speed = self._bar.tasks[0].speed
        rate = f"{speed:.1f}/s" if speed else ""
        text = f"labelling, {failed} failed" if failed else "labelling"
        self._bar.update(self._task, completed=done, total=total, description=text, rate=rate)
