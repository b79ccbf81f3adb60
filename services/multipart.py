"""Request bodies, read with their limits: what is too large is refused while it streams in."""

from __future__ import annotations

from collections.abc import AsyncGenerator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fastapi import Request
from python_multipart.exceptions import FormParserError
from python_multipart.multipart import MultipartParser, parse_options_header

from services.problems import ProblemError, field_error


class Part(NamedTuple):
    """One part of a multipart body. Its file name is never looked at."""

    name: str
    data: bytes


@dataclass(frozen=True)
class Allowed:
    """How many parts of a name a body may have, and how large each may be."""

    parts: int
    bytes: int


def media_type(request: Request) -> str:
    """The content type without its parameters, in lower case; empty when there is none."""
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


async def whole(request: Request, *, field: str, max_bytes: int) -> bytes:
    """The body, called ``field`` in the problem of one that is larger than ``max_bytes``."""
    announced = request.headers.get("content-length", "")
    if announced.isdecimal() and int(announced) > max_bytes:
        raise _too_large(field, max_bytes)
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > max_bytes:
            raise _too_large(field, max_bytes)
    return bytes(body)


async def parts(request: Request, allowed: Mapping[str, Allowed]) -> AsyncGenerator[Part]:
    """The parts of a multipart body as they arrive, so that only one of them is in memory at a
    time.

    Raises: ProblemError: for a part that is not in ``allowed``, one too many, one too large, or a
        broken body.
    """
    reader = _PartReader(request.headers["content-type"], allowed)
    async for chunk in request.stream():
        for part in reader.feed(chunk):
            yield part
    if not reader.ended:
        raise _broken("it ends before its last boundary")


class _PartReader:
    """Bytes in, whole parts out."""

    def __init__(self, content_type: str, allowed: Mapping[str, Allowed]) -> None:
        self.ended = False
        self._allowed = allowed
        self._seen = dict.fromkeys(allowed, 0)
        self._name = ""
        self._header = (bytearray(), bytearray())
        self._disposition = b""
        self._data = bytearray()
        self._done: list[Part] = []
        self._parser = self._start(content_type)

    def feed(self, chunk: bytes) -> list[Part]:
        """Parts that ``chunk`` completes."""
        try:
            self._parser.write(chunk)
        except FormParserError as error:
            raise _broken(str(error)) from error
        done, self._done = self._done, []
        return done

    def _start(self, content_type: str) -> MultipartParser:
        boundary = parse_options_header(content_type)[1].get(b"boundary")
        if not boundary:
            raise _broken("its content type names no boundary")
        try:
            return MultipartParser(
                boundary,
                {
                    "on_part_begin": self._begin,
                    "on_header_field": lambda data, start, end: self._header[0].extend(
                        data[start:end]
                    ),
                    "on_header_value": lambda data, start, end: self._header[1].extend(
                        data[start:end]
                    ),
                    "on_header_end": self._end_header,
                    "on_headers_finished": self._open,
                    "on_part_data": self._add,
                    "on_part_end": self._end,
                    "on_end": self._finish,
                },
            )
        except FormParserError as error:
            raise _broken(str(error)) from error

    def _begin(self) -> None:
        self._disposition = b""
        self._data = bytearray()

    def _end_header(self) -> None:
        name, value = self._header
        if name.lower() == b"content-disposition":
            self._disposition = bytes(value)
        self._header = (bytearray(), bytearray())

    def _open(self) -> None:
        name = (
            parse_options_header(self._disposition)[1].get(b"name", b"").decode("utf-8", "replace")
        )
        if name not in self._allowed:
            raise field_error(name or "body", f"unknown part; known: {', '.join(self._allowed)}")
        self._seen[name] += 1
        most = self._allowed[name].parts
        if self._seen[name] > most:
            raise field_error(
                name, f"at most {most} part(s) of this name are taken", code="too_many_parts"
            )
        self._name = name

    def _add(self, data: bytes, start: int, end: int) -> None:
        limit = self._allowed[self._name].bytes
        if len(self._data) + end - start > limit:
            raise _too_large(self._name, limit)
        self._data += data[start:end]

    def _end(self) -> None:
        self._done.append(Part(self._name, bytes(self._data)))

    def _finish(self) -> None:
        self.ended = True


def _too_large(field: str, max_bytes: int) -> ProblemError:
    return field_error(field, f"is larger than {max_bytes} bytes", code="too_large", status=413)


def _broken(why: str) -> ProblemError:
    return field_error("body", f"is not valid multipart/form-data: {why}", code="invalid_body")
