"""Every call of the API as data: what is sent, and how the reply is read. Both clients send these.

The only input or output here is that pictures are read.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any, Generic, TypeVar, cast
from urllib.parse import quote
from uuid import uuid4

import httpx
from pydantic import TypeAdapter, ValidationError

from dlo_client.connection import header_value
from dlo_client.contracts import (
    AnyJob,
    FileRef,
    ImageInfo,
    Job,
    JobKind,
    JobPage,
    JobRequest,
    JobState,
    NetworkInfo,
    Problem,
    UploadRef,
)
from dlo_client.contracts.base import ResultT
from dlo_client.contracts.unsure import UnsurePicture
from dlo_client.errors import (
    APIError,
    ConnectionFailed,
    InvalidArgument,
    UnexpectedReply,
    describe_fields,
    refusal,
)
from dlo_client.pictures import Part, Picture, Pictures, part_of, parts_of
from dlo_client.retry import Outcome, retry_after_s

T = TypeVar("T")

JobOrId = Job[Any] | str

LONGEST_WAIT_S = 60.0
"""The longest ``?wait=`` the service accepts."""

GRACE_S = 10.0
"""How long after a request's own time limit its job has surely ended: the service ends it then."""


@dataclass(frozen=True, slots=True)
class Call(Generic[T]):
    """One HTTP call: ``body`` in httpx's arguments, ``held_s`` how long the service may hold the
    reply; ``fine``: statuses of refusals that are as good as a success."""

    method: str
    path: str
    read: Callable[[httpx.Response], T]
    params: Mapping[str, str | int | float] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    body: Mapping[str, Any] = field(default_factory=dict)
    held_s: float = 0.0
    fine: tuple[int, ...] = ()
    request_id: str = field(default_factory=lambda: uuid4().hex)
    """The same for every attempt; the logs of the service, and of the worker that does the job,
    have it."""

    def build(self, http: httpx.Client | httpx.AsyncClient, timeout_s: float) -> httpx.Request:
        if http.is_closed:
            raise ConnectionFailed("this client has been closed")
        return http.build_request(
            self.method,
            self.path,
            params=self.params,
            headers={_REQUEST_ID: self.request_id, **self.headers},
            timeout=httpx.Timeout(timeout_s, read=timeout_s + self.held_s),
            **self.body,
        )

    def finish(self, outcome: Outcome) -> T:
        """The reply's value; raises ConnectionFailed, APIError or UnexpectedReply."""
        if isinstance(outcome, httpx.RequestError):
            raise connection_failed(outcome) from outcome
        if outcome.status_code not in self.fine:
            check(outcome)
        return self.read(outcome)


def upload(image: Picture) -> Call[ImageInfo]:
    body = {"content": part_of(image, "image").data}
    return Call("POST", "/v1/images", reader(ImageInfo), headers=_BINARY, body=body)


def submit(
    request: JobRequest[ResultT],
    images: Pictures | None = None,
    mask: Picture | None = None,
    wait: float = 0.0,
    idempotency_key: str | None = None,
    depth: Picture | None = None,
) -> Call[Job[ResultT]]:
    """JSON, or multipart when pictures come along. Without a key of the caller's it gets one of its
    own."""
    return Call(
        "POST",
        "/v1/jobs",
        cast(Callable[[httpx.Response], Job[ResultT]], reader(AnyJob)),
        params=wait_params(wait),
        headers={
            "Idempotency-Key": header_value(idempotency_key or uuid4().hex, "idempotency_key")
        },
        body=_job_body(request, parts_of(images, "image"), mask, depth),
        held_s=wait,
    )


def get(job: JobOrId, wait: float = 0.0) -> Call[Job[Any]]:
    return Call("GET", job_path(job), reader(AnyJob), params=wait_params(wait), held_s=wait)


def cancel(job: JobOrId) -> Call[AnyJob]:
    return Call("DELETE", job_path(job), reader(AnyJob))


def jobs(
    state: JobState | None, kind: JobKind | None, limit: int, cursor: str | None
) -> Call[JobPage]:
    params = {"limit": limit, "state": state, "kind": kind, "cursor": cursor}
    given = {name: value for name, value in params.items() if value is not None}
    return Call("GET", "/v1/jobs", reader(JobPage), params=given)


def events(job: JobOrId, after: str | None) -> Call[None]:
    """The stream itself is read by the client, line by line."""
    resume = {"Last-Event-ID": after} if after else {}
    headers = {"Accept": "text/event-stream", **resume}
    path = f"{job_path(job)}/events"
    return Call("GET", path, nothing, headers=headers, held_s=LONGEST_WAIT_S)


def file(job: JobOrId, file: FileRef | str) -> Call[bytes]:
    name = file.name if isinstance(file, FileRef) else file
    if not isinstance(name, str) or not name:
        raise InvalidArgument("file", f"{file!r} is neither a file of a job nor the name of one")
    return Call(
        "GET", f"{job_path(job)}/files/{quote(name, safe='')}", lambda response: response.content
    )


def networks() -> Call[list[NetworkInfo]]:
    return Call("GET", "/v1/models", reader(list[NetworkInfo]))


def upload_labels(archive: bytes) -> Call[UploadRef]:
    return Call("POST", "/v1/labels", reader(UploadRef), headers=_BINARY, body={"content": archive})


def network(name: str) -> Call[NetworkInfo]:
    return Call("GET", _network_path(name), reader(NetworkInfo))


def network_file(name: str, version: int | None) -> Call[bytes]:
    return Call(
        "GET",
        f"{_network_path(name)}/file",
        lambda response: response.content,
        params=_version(version),
    )


def import_network(file: Picture, name: str | None) -> Call[NetworkInfo]:
    """A worker checks it before the reply comes."""
    return Call(
        "POST",
        "/v1/models",
        reader(NetworkInfo),
        params={"name": name} if name else {},
        headers={**_BINARY, "Idempotency-Key": uuid4().hex},
        body={"content": part_of(file, "file").data},
        held_s=LONGEST_WAIT_S,
    )


def choose_version(name: str, version: int) -> Call[NetworkInfo]:
    return Call(
        "PUT", _network_path(name), reader(NetworkInfo), body={"json": {"version": version}}
    )


def delete_network(name: str, version: int | None) -> Call[None]:
    return Call("DELETE", _network_path(name), nothing, params=_version(version))


def unsure() -> Call[list[UnsurePicture]]:
    return Call("GET", "/v1/unsure", reader(list[UnsurePicture]))


def unsure_picture(picture: UnsurePicture) -> Call[bytes]:
    return Call("GET", f"/v1/unsure/{picture.id}", lambda response: response.content)


def drop_unsure(picture: UnsurePicture) -> Call[None]:
    return Call("DELETE", f"/v1/unsure/{picture.id}", nothing)


def ready() -> Call[None]:
    return Call("GET", "/readyz", nothing)


def patience_s(request: JobRequest[Any], timeout: float | None) -> float:
    """How long ``run`` waits for the job of ``request``."""
    return request.timeout_s + GRACE_S if timeout is None else seconds(timeout)


def seconds(timeout: float) -> float:
    """``timeout`` itself. Raises InvalidArgument when it is no time to wait: negative, NaN or no
    number."""
    if isinstance(timeout, Real) and timeout >= 0:
        return float(timeout)
    raise InvalidArgument("timeout", f"{timeout!r} is no number of seconds from 0 on")


def blocking(client: Any, who: str) -> None:
    """Raises InvalidArgument when ``who`` was given an AsyncClient, whose answers it could not wait
    for."""
    if inspect.iscoroutinefunction(getattr(client, "run", None)):
        raise InvalidArgument(
            "client", f"{who} waits for answers: give it a Client, not an AsyncClient"
        )


def awaited(job: Job[ResultT]) -> Job[ResultT]:
    """``job`` itself. Raises InvalidArgument for its id alone."""
    if not isinstance(job, Job):
        raise InvalidArgument("job", "is the job itself, which get(id) gives")
    return job


def check(response: httpx.Response) -> None:
    """Raise the APIError of a reply that is not a success; its body must have been read."""
    if response.is_success:
        return
    if response.is_redirect:
        raise UnexpectedReply(
            f"{response.request.url} answers with a redirect; is the address right?"
        )
    raise _refused(response)


def connection_failed(error: httpx.RequestError) -> ConnectionFailed:
    address = error.request.url.copy_with(query=None)
    return ConnectionFailed(f"cannot reach {address}: {error or type(error).__name__}")


_REQUEST_ID = "X-Request-ID"
_BINARY = {"Content-Type": "application/octet-stream"}


def _refused(response: httpx.Response) -> APIError:
    try:
        problem = Problem.model_validate_json(response.content)
    except ValidationError:
        problem = _foreign_problem(response)
    return refusal(problem, retry_after_s(response), response.headers.get(_REQUEST_ID))


def _foreign_problem(response: httpx.Response) -> Problem:
    """For an error page that is not ours, such as a proxy's."""
    title = f"{response.status_code} {response.reason_phrase}".strip()
    detail = response.text[:200].strip()
    return Problem(title=title, status=response.status_code, detail=detail, code="foreign_error")


def nothing(response: httpx.Response) -> None:
    """For a reply whose status states it all."""


def reader(kind: type[T]) -> Callable[[httpx.Response], T]:
    """Reads a reply as ``kind``; raises UnexpectedReply."""

    def read(response: httpx.Response) -> T:
        try:
            return TypeAdapter(kind).validate_json(response.content)
        except ValidationError as error:
            raise UnexpectedReply(
                f"{response.request.url} did not answer as this API: {describe_fields(error)}"
            ) from error

    return read


def job_path(job: JobOrId) -> str:
    """Raises InvalidArgument for what is no job."""
    job_id = job.id if isinstance(job, Job) else job
    if not isinstance(job_id, str) or not job_id:
        raise InvalidArgument("job", f"{job!r} is neither a job nor the id of one")
    return f"/v1/jobs/{quote(job_id, safe='')}"


def _network_path(name: str) -> str:
    if not isinstance(name, str) or not name:
        raise InvalidArgument("name", f"{name!r} is no name of a network")
    return f"/v1/models/{quote(name, safe='')}"


def _version(version: int | None) -> dict[str, int]:
    return {} if version is None else {"version": version}


def wait_params(wait: float) -> dict[str, float]:
    """``?wait=``, if there is anything to wait for."""
    return {"wait": round(wait, 3)} if wait > 0 else {}


def _job_body(
    request: JobRequest[Any], images: Sequence[Part], mask: Picture | None, depth: Picture | None
) -> dict[str, Any]:
    if not isinstance(request, JobRequest):
        raise InvalidArgument(
            "request", f"{type(request).__name__} is no request: give an InstancesRequest, …"
        )
    parts = [("image", image) for image in images]
    for name, picture in (("mask", mask), ("depth", depth)):
        if picture is not None:
            parts.append((name, part_of(picture, name)))
    if not parts:
        return {"json": request.model_dump(mode="json", exclude_none=True)}
    files = [(field, (name, data, "application/octet-stream")) for field, (name, data) in parts]
    return {"data": {"request": request.model_dump_json(exclude_none=True)}, "files": files}
