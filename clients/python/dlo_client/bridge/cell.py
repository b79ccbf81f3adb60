"""What the controllers of one cell ask for, whatever they speak: trigger, picture, result, cancel,
state.

Strategy: a trigger takes its picture and starts a job, and answers at once; the job goes on beside
the next trigger. A result is asked for by the sequence number that the controller gave, and may be
waited for. The last results stay.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field

from dlo_client.async_client import AsyncClient
from dlo_client.bridge.settings import JobsSection
from dlo_client.bridge.status import Status, of_error, of_job
from dlo_client.contracts.frames import RobotPose

TakePicture = Callable[[], Awaitable[bytes]]
_RESULTS_KEPT = 64
LARGEST_SEQUENCE = 2**31 - 1


class NoPictureError(Exception):
    """The camera or the folder gave no picture."""


@dataclass(frozen=True)
class Outcome:
    """How a job stands. ``recipe`` and ``version`` are 0 until they are known."""

    status: Status
    poses: Sequence[RobotPose] = ()
    recipe: int = 0
    version: int = 0
    time_ms: int = 0


@dataclass(frozen=True)
class CellState:
    """``busy``: jobs under way; ``waiting``: results that nobody has asked for; both counts of jobs
    ever ended."""

    busy: int
    waiting: int
    done: int
    failed: int


@dataclass
class _Open:
    """A sequence number in use: pictures so far, then the job."""

    pictures: list[bytes] = field(default_factory=list)
    flange: list[Sequence[float]] = field(default_factory=list)
    task: asyncio.Task[Outcome] | None = None
    asked: bool = False
    taking: bool = False
    """A picture is being taken for it."""


class Cell:
    """The jobs of one bridge; to be used on one event loop."""

    def __init__(
        self, client: AsyncClient, take_picture: TakePicture, settings: JobsSection
    ) -> None:
        self._client = client
        self._take = take_picture
        self._settings = settings
        self._open: dict[int, _Open] = {}
        self._done = self._failed = 0

    async def picture(self, sequence: int, flange: Sequence[float] = ()) -> Status:
        """Take one more picture for the job that will be triggered under this number."""
        known = self._open.get(sequence)
        if known is not None and (known.task is not None or known.taking):
            return Status.SEQUENCE_IN_USE
        if known is None and self._busy() >= self._settings.most_waiting:
            return Status.TOO_MANY_JOBS
        return await self._add(self._open.setdefault(sequence, _Open()), flange)

    async def trigger(self, sequence: int, recipe: int, flange: Sequence[float] = ()) -> Status:
        """Take a picture and start the recipe with it and those before; a number whose job has
        ended is used anew."""
        known = self._open.get(sequence)
        if known is not None and known.taking:
            return Status.SEQUENCE_IN_USE
        if known is not None and known.task is not None:
            if not known.task.done():
                return Status.SEQUENCE_IN_USE
            del self._open[sequence]
            known = None
        if known is None and self._busy() >= self._settings.most_waiting:
            return Status.TOO_MANY_JOBS
        one = self._open.setdefault(sequence, _Open())
        status = await self._add(one, flange)
        if status is not Status.ACCEPTED:
            if not one.pictures:
                self._open.pop(sequence, None)
            return status
        one.task = asyncio.create_task(self._run(recipe, one))
        self._forget_oldest()
        return Status.ACCEPTED

    async def result(self, sequence: int, wait_s: float | None = None) -> Outcome:
        """The outcome of a triggered job, waited for up to ``wait_s`` (default: as configured)."""
        one = self._open.get(sequence)
        if one is None or one.task is None:
            return Outcome(Status.UNKNOWN_SEQUENCE)
        wait_s = self._settings.result_wait_s if wait_s is None else min(wait_s, 60.0)
        await asyncio.wait({one.task}, timeout=wait_s)
        if not one.task.done():
            return Outcome(Status.RUNNING)
        one.asked = True
        return Outcome(Status.CANCELLED) if one.task.cancelled() else one.task.result()

    def cancel(self, sequence: int) -> Status:
        """End a job, or drop the pictures that were taken for one."""
        one = self._open.get(sequence)
        if one is None:
            return Status.UNKNOWN_SEQUENCE
        if one.task is None:
            del self._open[sequence]
        else:
            one.task.cancel()
        return Status.OK

    def state(self) -> CellState:
        """For a heartbeat."""
        ended = [one for one in self._open.values() if one.task is not None and one.task.done()]
        return CellState(
            self._busy(), sum(not one.asked for one in ended), self._done, self._failed
        )

    async def close(self) -> None:
        """End all jobs."""
        tasks = [one.task for one in self._open.values() if one.task is not None]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _busy(self) -> int:
        return sum(one.task is None or not one.task.done() for one in self._open.values())

    async def _add(self, one: _Open, flange: Sequence[float]) -> Status:
        one.taking = True
        try:
            one.pictures.append(await self._take())
        except NoPictureError:
            return Status.NO_PICTURE
        finally:
            one.taking = False
        if flange:
            one.flange.append(flange)
        return Status.ACCEPTED

    async def _run(self, recipe: int, one: _Open) -> Outcome:
        started = time.monotonic()
        outcome = await self._outcome(recipe, one)
        self._done += 1
        self._failed += outcome.status >= Status.UNKNOWN_COMMAND
        one.pictures.clear()
        took_ms = round(1000 * (time.monotonic() - started))
        return Outcome(outcome.status, outcome.poses, recipe, outcome.version, took_ms)

    async def _outcome(self, recipe: int, one: _Open) -> Outcome:
        run = self._client.run_recipe
        try:
            job = await run(
                recipe, one.pictures, flange=one.flange, timeout=self._settings.timeout_s
            )
        except Exception as error:
            return Outcome(of_error(error))
        poses = job.poses.poses if job.poses else ()
        return Outcome(of_job(job), poses, version=job.recipe.version if job.recipe else 0)

    def _forget_oldest(self) -> None:
        ended = [
            number for number, one in self._open.items() if one.task is not None and one.task.done()
        ]
        for number in ended[: max(0, len(self._open) - _RESULTS_KEPT)]:
            del self._open[number]
