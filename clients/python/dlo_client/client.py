"""The synchronous client: what it sends is in ``calls.py``, when it sends again in ``retry.py``."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from types import TracebackType
from typing import Self

import httpx

from dlo_client import calls, recipe_calls, track
from dlo_client.calls import LONGEST_WAIT_S, Call, JobOrId, T
from dlo_client.connection import (
    DEFAULT_TIMEOUT_S,
    POLL_PAUSE_S,
    Address,
    base_headers,
    base_url,
    stream_address,
)
from dlo_client.contracts import (
    AnyJob,
    FileRef,
    ImageInfo,
    Job,
    JobEvent,
    JobKind,
    JobRequest,
    JobState,
    NetworkInfo,
    TrackOptions,
    UploadRef,
)
from dlo_client.contracts.base import ResultT
from dlo_client.contracts.recipes import CameraBody, Recipe, RecipeBody, StoredCamera
from dlo_client.contracts.unsure import UnsurePicture
from dlo_client.errors import WaitTimeout
from dlo_client.event_stream import EventCursor
from dlo_client.outcomes import result_of, succeeded
from dlo_client.pictures import Picture, Pictures
from dlo_client.retry import Outcome, RetryPolicy
from dlo_client.track import Track


class Client:
    """The service, from Python.

    What the methods raise is a :class:`~dlo_client.errors.DLOError`, or an OSError for a picture
    file that cannot be read.

    ``url`` and ``api_key`` default to ``DLO_URL`` and ``DLO_API_KEY``; ``timeout_s`` bounds the
    silence on one connection; ``transport`` replaces the network: tests give an
    ``httpx.MockTransport``.
    """

    def __init__(
        self,
        url: str | None = None,
        api_key: str | None = None,
        *,
        timeout_s: float = DEFAULT_TIMEOUT_S,
        retry: RetryPolicy | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self._timeout_s = timeout_s
        self._retry = retry or RetryPolicy()
        self._http = httpx.Client(
            base_url=base_url(url), headers=base_headers(api_key), transport=transport
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    def upload(self, image: Picture) -> ImageInfo:
        """Store a picture for several jobs; the same bytes give the same id."""
        return self._send(calls.upload(image))

    def upload_labels(self, archive: bytes) -> UploadRef:
        """Store labelled pictures for ``adapt`` jobs; ``dlo_client.labelling.adaptation`` makes the
        archive."""
        return self._send(calls.upload_labels(archive))

    def submit(
        self,
        request: JobRequest[ResultT],
        images: Pictures | None = None,
        *,
        mask: Picture | None = None,
        depth: Picture | None = None,
        wait: float = 0.0,
        idempotency_key: str | None = None,
    ) -> Job[ResultT]:
        """Hand in a job and return it at once, queued or running; ``wait``: seconds (at most 60) to
        hold the reply.

        ``images``: one picture or several in order; ``mask``: the foreground; ``depth``: a depth
        map, encoded or as an array of 16 bits in millimeters. ``idempotency_key`` instead of a
        random one: for a caller that may itself submit the same thing twice.
        """
        return self._send(calls.submit(request, images, mask, wait, idempotency_key, depth))

    def run(
        self,
        request: JobRequest[ResultT],
        image: Pictures | None = None,
        *,
        mask: Picture | None = None,
        depth: Picture | None = None,
        timeout: float | None = None,
    ) -> ResultT:
        """The result of a request: submit, wait, insist on success.

        ``timeout``: seconds to wait, by default the request's own limit. Raises JobFailed,
        JobCancelled, WaitTimeout.
        """
        return result_of(self.run_job(request, image, mask=mask, depth=depth, timeout=timeout))

    def run_job(
        self,
        request: JobRequest[ResultT],
        image: Pictures | None = None,
        *,
        mask: Picture | None = None,
        depth: Picture | None = None,
        timeout: float | None = None,
    ) -> Job[ResultT]:
        """As :meth:`run`, but the whole job: its files, timings and robot poses beside the
        result."""
        patience_s = calls.patience_s(request, timeout)
        deadline = time.monotonic() + patience_s
        held_s = min(patience_s, LONGEST_WAIT_S)
        job = self._send(calls.submit(request, image, mask, held_s, depth=depth), deadline)
        return succeeded(self._ended(job, deadline, patience_s))

    def result(self, job: Job[ResultT], timeout: float = 60.0) -> ResultT:
        """The result of a submitted job, once it has ended; raises as :meth:`run` does."""
        return result_of(self.wait(job, timeout))

    def run_recipe(
        self,
        number: int,
        images: Pictures | None = None,
        *,
        mask: Picture | None = None,
        depth: Picture | None = None,
        flange: Sequence[Sequence[float]] = (),
        version: int | None = None,
        timeout: float = 60.0,
    ) -> AnyJob:
        """The ended job of a stored recipe with these pictures; ``flange``: x, y, z, rotation, one
        a picture."""
        deadline = time.monotonic() + calls.seconds(timeout)
        held_s = min(timeout, LONGEST_WAIT_S)
        call = recipe_calls.run(
            number, images, mask=mask, flange=flange, version=version, wait=held_s, depth=depth
        )
        return succeeded(self._ended(self._send(call, deadline), deadline, timeout))

    def submit_recipe(
        self,
        number: int,
        images: Pictures | None = None,
        *,
        mask: Picture | None = None,
        depth: Picture | None = None,
        flange: Sequence[Sequence[float]] = (),
        version: int | None = None,
        wait: float = 0.0,
    ) -> AnyJob:
        """The job of a stored recipe with these pictures, as it is after ``wait`` seconds."""
        return self._send(
            recipe_calls.run(
                number, images, mask=mask, flange=flange, version=version, wait=wait, depth=depth
            )
        )

    def store_recipe(self, number: int, recipe: RecipeBody) -> Recipe:
        """Store a recipe under a number; the next version if there is one."""
        return self._send(recipe_calls.store(number, recipe))

    def recipes(self) -> list[Recipe]:
        """The latest version of every recipe, by number."""
        return self._send(recipe_calls.every())

    def recipe_of(self, job: JobOrId) -> RecipeBody:
        """A recipe that repeats a job: its request, with its pictures as samples."""
        return self._send(recipe_calls.of_job(job))

    def dry_run(self, number: int) -> list[AnyJob]:
        """Jobs of a recipe with its stored pictures."""
        return self._send(recipe_calls.dry_run(number))

    def store_camera(self, name: str, camera: CameraBody | Picture) -> StoredCamera:
        """Store a calibration: poses and intrinsics, or a YAML file of ROS, OpenCV or Kalibr."""
        return self._send(recipe_calls.store_camera(name, camera))

    def cameras(self) -> list[StoredCamera]:
        """The latest version of every stored camera, by name."""
        return self._send(recipe_calls.cameras())

    def wait(self, job: Job[ResultT], timeout: float = 60.0) -> Job[ResultT]:
        """The job once it has ended, whichever way; WaitTimeout after ``timeout`` seconds."""
        return self._ended(calls.awaited(job), time.monotonic() + calls.seconds(timeout), timeout)

    def get(self, job: JobOrId) -> AnyJob:
        """The job as it is now."""
        return self._send(calls.get(job))

    def cancel(self, job: JobOrId) -> AnyJob:
        """End a queued or running job; a finished one stays as it is."""
        return self._send(calls.cancel(job))

    def jobs(
        self, *, state: JobState | None = None, kind: JobKind | None = None, page_size: int = 50
    ) -> Iterator[AnyJob]:
        """Recent jobs, newest first; a page is fetched when the iteration reaches it."""
        cursor: str | None = None
        while True:
            page = self._send(calls.jobs(state, kind, page_size, cursor))
            yield from page.jobs
            cursor = page.next_cursor
            if cursor is None:
                return

    def events(self, job: JobOrId) -> Iterator[JobEvent]:
        """State and progress as they change, until the job ends; a broken stream is resumed."""
        cursor = EventCursor()
        while not cursor.ended:
            try:
                yield from self._stream(calls.events(job, cursor.last_id), cursor)
            except httpx.RequestError as error:
                pause_s = self._retry.pause_s(cursor.broken(), error)
                if pause_s is None:
                    raise calls.connection_failed(error) from error
                time.sleep(pause_s)

    def file(self, job: JobOrId, file: FileRef | str) -> bytes:
        """A file of a result, such as ``overlay.png``; the job's ``files`` lists them."""
        return self._send(calls.file(job, file))

    def networks(self) -> list[NetworkInfo]:
        """The networks of the workers that are alive, and those that were adapted or brought
        there."""
        return self._send(calls.networks())

    def network(self, name: str) -> NetworkInfo:
        """One of them, with its versions."""
        return self._send(calls.network(name))

    def network_file(self, name: str, version: int | None = None) -> bytes:
        """The file of an adapted network, by default of the version that its name stands for."""
        return self._send(calls.network_file(name, version))

    def import_network(self, file: Picture, name: str | None = None) -> NetworkInfo:
        """Take in a network from its file; it becomes the next version of ``name``, or of the name
        in the file."""
        return self._send(calls.import_network(file, name))

    def choose_version(self, name: str, version: int) -> NetworkInfo:
        """Let the name stand for another of its versions."""
        return self._send(calls.choose_version(name, version))

    def delete_network(self, name: str, version: int | None = None) -> None:
        """Delete an adapted network, or one of its versions."""
        return self._send(calls.delete_network(name, version))

    def unsure(self) -> list[UnsurePicture]:
        """The caller's pictures that the service was least sure of, of requests with
        ``keep_if_unsure``."""
        return self._send(calls.unsure())

    def unsure_picture(self, picture: UnsurePicture) -> bytes:
        """One of them, as it was sent."""
        return self._send(calls.unsure_picture(picture))

    def drop_unsure(self, picture: UnsurePicture) -> None:
        """Forget one of them."""
        return self._send(calls.drop_unsure(picture))

    def ready(self) -> bool:
        """Whether the service can take jobs now; False also while nobody answers."""
        outcome = self._attempt(calls.ready().build(self._http, self._timeout_s))
        return isinstance(outcome, httpx.Response) and outcome.is_success

    def track(self, options: TrackOptions | None = None) -> Track:
        """Begin a track: pictures in which cables keep their ids."""
        return Track(self, self.send(track.begin(options)))

    def stream_address(self, path: str) -> Address:
        """Where a WebSocket of the service is."""
        return stream_address(self._http, path, self._timeout_s)

    def send(self, call: Call[T]) -> T:
        """Send what :mod:`dlo_client.calls` describes, again where that may help; its answer."""
        return self._send(call)

    def _ended(self, job: Job[ResultT], deadline: float, patience_s: float) -> Job[ResultT]:
        """The job once it has ended; at ``deadline`` WaitTimeout, after ``patience_s`` seconds in
        all."""
        while not job.state.final:
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                raise WaitTimeout(job, patience_s)
            job = self._send(calls.get(job, min(left_s, LONGEST_WAIT_S)), deadline)
            if not job.state.final:
                time.sleep(POLL_PAUSE_S)
        return job

    def _send(self, call: Call[T], deadline: float = math.inf) -> T:
        """Send until it succeeds, is refused for good, or another pause would pass ``deadline``."""
        request = call.build(self._http, self._timeout_s)
        attempt = 1
        while True:
            outcome = self._attempt(request)
            pause_s = self._retry.pause_s(attempt, outcome)
            if pause_s is None or time.monotonic() + pause_s > deadline:
                return call.finish(outcome)
            time.sleep(pause_s)
            attempt += 1

    def _attempt(self, request: httpx.Request) -> Outcome:
        try:
            return self._http.send(request)
        except httpx.RequestError as error:
            return error

    def _stream(self, call: Call[None], cursor: EventCursor) -> Iterator[JobEvent]:
        """The events of one connection; one that ends before the job does counts as broken."""
        with closing(
            self._http.send(call.build(self._http, self._timeout_s), stream=True)
        ) as response:
            if not response.is_success:
                response.read()
            call.finish(response)
            for line in response.iter_lines():
                event = cursor.feed(line)
                if event is not None:
                    yield event
        cursor.check_end(response)
