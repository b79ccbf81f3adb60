"""The JSON of a request to a checked one that names its pictures by blob id.

Strategy: everything here is a function of bytes alone, so that it can run where it harms nobody. A
small body is checked on the event loop at once. Parsing and validating hold the interpreter's lock,
in a thread too; hence a large body is checked in another process, with a time and a memory limit,
and there only the first error of each list is looked for: hundreds of thousands of errors cost a
minute to collect.
"""

from __future__ import annotations

import gc
import resource
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from anyio import CapacityLimiter, move_on_after, to_process
from dlo_client.contracts import (
    AnyRequest,
    CameraView,
    Contract,
    FieldProblem,
    ImagePart,
    ImageRef,
    UploadRef,
)
from pydantic import ValidationError
from pydantic_core import SchemaValidator, from_json

from services.fields import body_problems
from services.problems import MOST_ERRORS, ProblemError, field_error, fields_error
from workers.record import REQUEST, Entry

SMALL_BYTES = 16 * 1024
"""A body up to this size takes a few milliseconds at worst."""

_AT_ONCE = 2
_LIMIT_S = 30.0
_MEMORY_BYTES = 2 * 1024**3
_MISSING = "is missing: send an `image` part, or name an uploaded picture"


@dataclass(frozen=True)
class Given:
    """What a body brought: its JSON, and the ids of the pictures in its parts."""

    text: bytes
    whole: str
    """What the JSON as a whole is called in a problem."""
    images: tuple[str, ...] = ()
    mask: str | None = None
    defaults: Mapping[str, Any] = field(default_factory=dict)
    """Fields of a request that leaves them out, where its kind has them."""
    depth: str | None = None


@dataclass(frozen=True)
class Checked:
    """A valid request, ready for the queue once its pictures are found to be there and to fit
    together."""

    entry: Entry
    pictures: dict[str, str]
    """Field, as in ``views.0.image``, to the id of the picture that it names."""
    cameras: dict[str, tuple[int, int]]
    """Field of a view, as in ``views.0``, to the width and height that its intrinsics are of."""
    model: str | None = None
    """The network that it names."""
    uploads: dict[str, str] = field(default_factory=dict)
    """Field to the id of an upload that is no picture."""


class Refused(Exception):
    """The request is at fault. (Its arguments are all that it holds: it travels between
    processes.)"""

    def __init__(self, code: str, errors: list[FieldProblem], count: int = 1) -> None:
        """``errors`` are the first of ``count``."""
        super().__init__(code, errors, count)
        self.code = code
        self.errors = errors
        self.count = count


async def checked(given: Given, limiter: CapacityLimiter) -> Checked:
    """The request of ``given``; at most ``limiter`` large ones are checked at a time.

    Raises:
        ProblemError: naming the fields at fault.
    """
    try:
        if len(given.text) <= SMALL_BYTES:
            return check(given, REQUEST.validate_python)
        async with limiter:
            with move_on_after(_LIMIT_S):
                return await to_process.run_sync(check_large, given, cancellable=True)
    except Refused as error:
        raise _problem(error) from None
    except MemoryError:
        pass
    raise field_error(
        given.whole, "takes too long or too much memory to check", code="too_large", status=413
    )


def limiter() -> CapacityLimiter:
    """For :func:`checked`, one an application."""
    return CapacityLimiter(_AT_ONCE)


def check_large(given: Given) -> Checked:
    """:func:`check` in a process of its own, limited in memory; raises also MemoryError."""
    # it would go through a million new lists again and again; none of them is in a cycle
    gc.disable()
    resource.setrlimit(resource.RLIMIT_DATA, (_MEMORY_BYTES, resource.RLIM_INFINITY))
    return check(given, _first_errors().validate_python)


def check(given: Given, validate: Callable[[Any], AnyRequest]) -> Checked:
    """Parse, let the parts fill what is left out, validate, find the pictures; raises Refused."""
    fields = _parse(given)
    _fill(fields, given)
    try:
        request = validate(fields)
    except ValidationError as error:
        found = error.errors(include_url=False, include_input=False)
        problems = body_problems(found, fields, whole=given.whole)
        raise Refused("invalid_request", problems[:MOST_ERRORS], len(problems)) from None
    return _Pictures(given).resolve(request)


def _problem(error: Refused) -> ProblemError:
    if error.code == "invalid_request":
        return fields_error(error.errors, error.count)
    (only,) = error.errors
    return field_error(only.field, only.message, code=error.code)


def _refused(field: str, message: str, code: str = "invalid_request") -> Refused:
    return Refused(code, [FieldProblem(field=field, message=message)])


@cache
def _first_errors() -> SchemaValidator:
    """The validator of requests, but each list ends at its first error.

    Without the argument it would take the models' own validators, which know nothing of that.
    """
    return SchemaValidator(_fail_fast(REQUEST.core_schema), _use_prebuilt=False)


def _fail_fast(schema: Any) -> Any:
    match schema:
        case dict():
            ends = {"fail_fast": True} if schema.get("type") in ("list", "tuple") else {}
            return {name: _fail_fast(inner) for name, inner in schema.items()} | ends
        case list():
            return [_fail_fast(inner) for inner in schema]
        case tuple():
            return tuple(_fail_fast(inner) for inner in schema)
        case _:
            return schema


def _parse(given: Given) -> dict[str, Any]:
    try:
        fields = from_json(given.text)
    except ValueError as error:
        raise _refused(given.whole, f"is not JSON: {error}", "invalid_json") from None
    if not isinstance(fields, dict):
        raise _refused(given.whole, "should be a JSON object")
    return fields


def _fill(fields: dict[str, Any], given: Given) -> None:
    """Let the parts fill the image fields that ``fields`` leaves out; a kind without them refuses
    these.

    The fields are the ``image`` of every view in order where there are ``views``, else the one at
    the top.
    """
    views = fields.get("views")
    holders = (
        [view for view in views if isinstance(view, dict)] if isinstance(views, list) else [fields]
    )
    values = [value for holder in (fields, *holders) for value in holder.values()]
    inner = [one for value in values if isinstance(value, list) for one in value]
    sources = (value for value in (*values, *inner) if isinstance(value, dict))
    named = [source.get("part") for source in sources]
    free = [part for part in range(len(given.images)) if part not in named]
    empty = [holder for holder in holders if holder.get("image") is None]
    for holder, part in zip(empty, free, strict=False):
        holder["image"] = {"part": part}
    for name, blob_id in (("mask", given.mask), ("depth", given.depth)):
        if blob_id and fields.get(name) is not None:
            raise _refused(name, "is both in the request and a part of its own")
        if blob_id:
            fields[name] = {"id": blob_id}


class _Pictures:
    """Names the picture behind every image field of one request."""

    def __init__(self, given: Given) -> None:
        self._parts, self._defaults = given.images, given.defaults
        self._unused = set(range(len(given.images)))
        self._named: dict[str, str] = {}
        self._uploads: dict[str, str] = {}

    def resolve(self, request: AnyRequest) -> Checked:
        """``request`` with an :class:`ImageRef` for every picture; none is missing, no part is left
        over."""
        resolved: AnyRequest = self._walk(request, ())
        free = type(request).model_fields.keys() - request.model_fields_set
        resolved = resolved.model_copy(
            update={k: v for k, v in self._defaults.items() if k in free}
        )
        if self._unused:
            raise _refused("image", f"part {min(self._unused)} is not used by the request")
        if (
            "image" in type(request).model_fields
            and request.needs_picture
            and not {"image", "mask", "depth"} & {*self._named}
        ):
            raise _refused("image", _MISSING)
        cameras = self._cameras(getattr(request, "views", None) or [])
        return Checked(
            Entry.of(resolved), self._named, cameras, getattr(request, "model", None), self._uploads
        )

    def _cameras(self, views: Sequence[Any]) -> dict[str, tuple[int, int]]:
        """Every view has a picture; a planned pose has none."""
        sizes = {}
        for index, view in enumerate(views):
            if isinstance(view, CameraView):
                if f"views.{index}.image" not in self._named:
                    raise _refused(f"views.{index}.image", _MISSING)
                sizes[f"views.{index}"] = view.intrinsics.picture_size
        return sizes

    def _walk(self, value: Any, path: tuple[str, ...]) -> Any:
        match value:
            case ImagePart() | ImageRef():
                return self._reference(value, ".".join(path))
            case UploadRef():
                self._uploads[".".join(path)] = value.id
                return value
            case Contract():
                given = [
                    name for name in type(value).model_fields if name in value.model_fields_set
                ]
                return value.model_copy(
                    update={name: self._walk(getattr(value, name), (*path, name)) for name in given}
                )
            case list():
                return [self._walk(inner, (*path, str(index))) for index, inner in enumerate(value)]
            case _:
                return value

    def _reference(self, source: ImagePart | ImageRef, field: str) -> ImageRef:
        if isinstance(source, ImageRef):
            self._named[field] = source.id
            return source
        if source.part >= len(self._parts):
            raise _refused(field, f"this body has no `image` part {source.part} (counted from 0)")
        self._unused.discard(source.part)
        self._named[field] = self._parts[source.part]
        return ImageRef(id=self._named[field])
