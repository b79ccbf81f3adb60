"""Labelling many pictures: bounded concurrency, retries, and a ledger so that it can be killed at
any moment."""

from __future__ import annotations

import asyncio
import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from uuid import uuid4

import httpx

from dlo_client.async_client import AsyncClient
from dlo_client.contracts import InstancesRequest
from dlo_client.errors import (
    APIError,
    ConnectionFailed,
    DLOError,
    Gone,
    JobCancelled,
    JobFailed,
    QueueFull,
    ServiceFault,
    Unauthorized,
    UnexpectedReply,
    WaitTimeout,
)
from dlo_client.labelling.labels import label_of
from dlo_client.labelling.report import Report, make_report
from dlo_client.labelling.sources import Found, PictureUnreadable, SourcePicture, read_still
from dlo_client.labelling.store import Entry, LabelStore, StoreError
from dlo_client.outcomes import result_of, succeeded
from dlo_client.retry import RetryPolicy

_STOPPING = (ConnectionFailed, Unauthorized, UnexpectedReply)
"""After these the next picture would fare no better."""

Progress = Callable[[int, int, int], None]
"""Called with how many pictures are done, how many of these failed, and how many there are."""


class BatchStopped(Exception):
    """The run cannot go on now: nobody answers, the key is refused, the disk is full. The report
    has all the rest."""

    def __init__(self, report: Report) -> None:
        super().__init__(report.stopped)
        self.report = report


@dataclass(frozen=True)
class LabelOptions:
    """``request``: what every picture is asked with; it always goes to the ``batch`` queue.
    ``at_once``: pictures in flight. ``attempts``: of a picture whose job fails by the service's
    fault. ``retry_failed``: take up again what failed in an earlier run. ``pause_s``: before the
    next attempt; it doubles."""

    request: InstancesRequest = field(
        default_factory=lambda: InstancesRequest(files=[], timeout_s=600)
    )
    at_once: int = 8
    attempts: int = 3
    retry_failed: bool = False
    pause_s: float = 1.0
    retry: RetryPolicy = field(default_factory=lambda: RetryPolicy(attempts=8))

    def batch_request(self, name: str) -> InstancesRequest:
        label = name if len(name) <= 200 else name[-200:]
        return self.request.model_copy(update={"priority": "batch", "files": [], "label": label})

    def settings(self) -> dict[str, object]:
        """What a label depends on."""
        return self.request.model_dump(
            mode="json", include={"method", "model", "threshold", "params", "points_per_instance"}
        )


def label_pictures(
    pictures: Sequence[SourcePicture],
    out: Path,
    options: LabelOptions | None = None,
    *,
    url: str | None = None,
    api_key: str | None = None,
    progress: Progress | None = None,
    transport: httpx.AsyncBaseTransport | None = None,
) -> Report:
    """Label all ``pictures`` (see :func:`find_pictures`) into the folder ``out`` and report.

    What has a label is skipped unless its file is another one by now. A picture that fails keeps no
    other from its label. Raises StoreError for a folder that cannot be used, BatchStopped when the
    run cannot go on.
    """
    options = options or LabelOptions()
    with LabelStore(out, write=True) as store:
        store.remember(options.settings())
        if isinstance(pictures, Found):
            store.remember_source(pictures.source)
        run = _Run(store, options, pictures, progress or _nobody)
        stopped = asyncio.run(
            run.all(lambda: AsyncClient(url, api_key, retry=options.retry, transport=transport))
        )
        report = run.report(stopped)
        try:
            report.save(out)
        except OSError as error:
            stopped = stopped or f"the report cannot be written: {error.strerror}"
            raise BatchStopped(run.report(stopped)) from error
    if stopped is not None:
        raise BatchStopped(report)
    return report


def _nobody(done: int, failed: int, total: int) -> None:
    """Progress that nobody watches."""


class _Run:
    """One run over the pictures that have no label yet.

    Two files with the same bytes are labelled by one job: whoever comes first holds the content's
    lock.
    """

    def __init__(
        self,
        store: LabelStore,
        options: LabelOptions,
        pictures: Sequence[SourcePicture],
        progress: Progress,
    ) -> None:
        self._store, self._options, self._pictures, self._progress = (
            store,
            options,
            pictures,
            progress,
        )
        self._started = time.monotonic()
        self._waiting = iter(self._open(store.entries()))
        self._done = 0
        self._failed = 0
        self._now: set[str] = set()
        self._contents: dict[str, asyncio.Lock] = {}
        self._stopped: str | None = None
        self._salt = uuid4().hex if options.retry_failed else ""

    def _open(self, known: dict[str, Entry]) -> Iterator[SourcePicture]:
        """Pictures that have no label, or whose file is another one than when they got it."""
        for picture in self._pictures:
            entry = known.get(picture.name)
            settled = entry is not None and (
                entry.state != "failed" or not self._options.retry_failed
            )
            if entry is not None and settled and entry.stamp == (picture.stamp() or ""):
                self._count(entry.state == "failed")
            else:
                yield picture

    async def all(self, connect: Callable[[], AsyncClient]) -> str | None:
        """Label everything; why it stopped early, or None."""
        async with connect() as client:
            await asyncio.gather(*(self._take(client) for _ in range(self._options.at_once)))
        return self._stopped

    def report(self, stopped: str | None) -> Report:
        entries = self._store.entries()
        changed = [
            p.name
            for p in self._pictures
            if p.name in self._now and entries[p.name].stamp != (p.stamp() or "")
        ]
        names = [picture.name for picture in self._pictures]
        seconds = time.monotonic() - self._started
        skipped = self._pictures.skipped if isinstance(self._pictures, Found) else {}
        return make_report(entries, names, self._now, changed, seconds, stopped, skipped)

    async def _take(self, client: AsyncClient) -> None:
        for picture in self._waiting:
            try:
                await self._one(client, picture)
            except StoreError as error:
                self._stopped = str(error)
            except DLOError as error:
                self._stopped = self._stopped or str(error)
            if self._stopped is not None:
                return

    async def _one(self, client: AsyncClient, picture: SourcePicture) -> None:
        try:
            data, stamp = await asyncio.to_thread(read_still, picture)
        except PictureUnreadable as error:
            self._fail(picture, f"cannot be read: {error}", picture.stamp() or "")
            return
        sha256 = hashlib.sha256(data).hexdigest()
        async with self._contents.setdefault(sha256, asyncio.Lock()):
            twin = self._store.twin_of(sha256, picture.name)
            if twin is not None:
                self._copy(picture, twin, stamp, sha256)
                return
            await self._label(client, picture, data, stamp, sha256)

    async def _label(
        self, client: AsyncClient, picture: SourcePicture, data: bytes, stamp: str, sha256: str
    ) -> None:
        started = time.monotonic()
        request = self._options.batch_request(picture.name)
        for attempt in range(1, self._options.attempts + 1):
            try:
                key = _key(request, sha256, f"{attempt}{self._salt}")
                job = await client.submit(request, images=data, wait=30.0, idempotency_key=key)
                result = result_of(
                    succeeded(await client.wait(job, timeout=request.timeout_s + 10.0))
                )
            except _STOPPING:
                raise
            except (JobFailed, JobCancelled, WaitTimeout, APIError) as error:
                if attempt < self._options.attempts and _may_pass(error):
                    await asyncio.sleep(self._options.pause_s * 2.0 ** (attempt - 1))
                    continue
                if isinstance(error, QueueFull):
                    raise
                self._fail(picture, str(error), stamp, sha256)
                return
            label = label_of(result, picture.name, sha256)
            seconds = time.monotonic() - started
            entry = Entry(
                picture.name, "done", stamp, sha256, label.doubt, label.certainty, seconds
            )
            self._store.put(entry, label)
            self._settle(picture, failed=False)
            return

    def _copy(self, picture: SourcePicture, twin: str, stamp: str, sha256: str) -> None:
        label = self._store.label(twin).model_copy(update={"name": picture.name})
        self._store.put(
            Entry(picture.name, "duplicate", stamp, sha256, twin, label.certainty), label
        )
        self._settle(picture, failed=False)

    def _fail(self, picture: SourcePicture, why: str, stamp: str, sha256: str = "") -> None:
        self._store.put(Entry(picture.name, "failed", stamp, sha256, why))
        self._settle(picture, failed=True)

    def _settle(self, picture: SourcePicture, *, failed: bool) -> None:
        self._now.add(picture.name)
        self._count(failed)

    def _count(self, failed: bool) -> None:
        self._done += 1
        self._failed += failed
        self._progress(self._done, self._failed, len(self._pictures))


def _may_pass(error: Exception) -> bool:
    """Whether another attempt can end better: not after a refusal of what was asked."""
    if isinstance(error, JobFailed):
        return not error.problem.code.startswith("invalid_")
    return isinstance(error, JobCancelled | WaitTimeout | QueueFull | ServiceFault | Gone)


def _key(request: InstancesRequest, sha256: str, attempt: str) -> str:
    """The same picture asked the same way is the same job, also after this process was killed.
    (What failed before and is taken up again must be another one.)"""
    asked = json.dumps([request.model_dump(mode="json"), sha256, attempt], sort_keys=True)
    return hashlib.sha256(asked.encode()).hexdigest()
