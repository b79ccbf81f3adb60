"""Requests of a cell in a folder, with their pictures, answers and what became of them: to be
replayed elsewhere.

A recording is ``record.jsonl``, a line a request, and the pictures under ``pictures/`` by the
SHA-256 of their bytes. What became of an answer is known later: it is a line of its own. A line
that was cut off does not count.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, cast
from uuid import uuid4

from pydantic import TypeAdapter, ValidationError

from dlo_client.client import Client
from dlo_client.contracts import AnyRequest, Job, JobRequest
from dlo_client.contracts.base import ResultT
from dlo_client.errors import JobFailed
from dlo_client.pictures import Picture, Pictures, part_of, parts_of

RECORD, PICTURES = "record.jsonl", "pictures"
Outcome = Literal["good", "bad"]
_DIGITS = 64
"""Of the SHA-256 that is the id of an upload."""
_REQUEST: TypeAdapter[Any] = TypeAdapter(AnyRequest)


class RecordingError(Exception):
    """The folder holds no recording that can be read; the message states why."""


@dataclass(frozen=True)
class Entry:
    """One request. ``images`` and ``mask``: SHA-256 of the pictures that went along; ``result`` or
    ``problem`` of the answer; ``outcome``: whether the cell could use it, once that is known, and a
    ``note`` on it."""

    id: str
    request: dict[str, Any]
    images: tuple[str, ...] = ()
    mask: str | None = None
    result: dict[str, Any] | None = None
    problem: dict[str, Any] | None = None
    timings_ms: dict[str, float] = field(default_factory=dict)
    outcome: Outcome | None = None
    note: str | None = None

    @property
    def kind(self) -> str:
        return str(self.request.get("kind"))

    def asked(self, **changes: Any) -> JobRequest[Any]:
        """The request again, with some fields changed. Raises RecordingError."""
        fields = type(_validated(self.request)).model_fields
        given = {
            name: value for name, value in changes.items() if value is not None and name in fields
        }
        return _validated(self.request | given)


class Recorder:
    """Runs requests as ``client`` does and keeps everything in ``folder``; a recording that is
    there goes on."""

    def __init__(self, client: Client, folder: Path) -> None:
        self._client, self._folder = client, folder
        (folder / PICTURES).mkdir(parents=True, exist_ok=True)

    def run(
        self,
        request: JobRequest[ResultT],
        image: Pictures | None = None,
        *,
        mask: Picture | None = None,
    ) -> tuple[str, Job[ResultT]]:
        """The id under which it is recorded, and the job. Raises what ``Client.run`` does; a job
        that failed is recorded too. Raises RecordingError for a request that names a picture by its
        id: only what goes along with it is kept."""
        if pictures_by_id(request.model_dump(mode="json", exclude_none=True)):
            raise RecordingError(
                "the request names an uploaded picture by its id; let it go along as a part instead"
            )
        images = tuple(self._kept(part.data) for part in parts_of(image, "image"))
        entry = Entry(
            uuid4().hex,
            request.model_dump(mode="json", exclude_none=True),
            images,
            None if mask is None else self._kept(part_of(mask, "mask").data),
        )
        sent = [self._folder / PICTURES / name for name in images]
        over = None if entry.mask is None else self._folder / PICTURES / entry.mask
        try:
            job = self._client.run_job(request, sent or None, mask=over)
        except JobFailed as failed:
            _append(
                self._folder, asdict(replace(entry, problem=failed.problem.model_dump(mode="json")))
            )
            raise
        assert job.result is not None
        result = job.result.model_dump(mode="json")
        _append(
            self._folder, asdict(replace(entry, result=result, timings_ms=dict(job.timings_ms)))
        )
        return entry.id, job

    def outcome(self, entry_id: str, outcome: Outcome, note: str | None = None) -> None:
        """What became of an answer: whether the cell could use it."""
        note_outcome(self._folder, entry_id, outcome, note)

    def _kept(self, data: bytes) -> str:
        name = sha256(data).hexdigest()
        place = self._folder / PICTURES / name
        if not place.exists():
            beside = place.with_name(f".{name}")
            beside.write_bytes(data)
            beside.replace(place)
        return name


def note_outcome(folder: Path, entry_id: str, outcome: Outcome, note: str | None = None) -> None:
    """Write down what became of a recorded answer; the last word counts."""
    _append(folder, {"id": entry_id, "outcome": outcome, "note": note})


def _append(folder: Path, line: dict[str, Any]) -> None:
    with (folder / RECORD).open("a", encoding="utf-8") as lines:
        lines.write(json.dumps(line, ensure_ascii=False) + "\n")


def pictures_by_id(request: Any) -> bool:
    """Whether a request, or a part of one, names a picture that was uploaded before."""
    if isinstance(request, dict):
        named = isinstance(request.get("id"), str) and len(request["id"]) == _DIGITS
        return named or any(pictures_by_id(inner) for inner in request.values())
    return isinstance(request, list) and any(pictures_by_id(inner) for inner in request)


def read_recording(folder: Path) -> list[Entry]:
    """In the order of the requests, each with the last word on its outcome. Raises
    RecordingError."""
    file = folder / RECORD
    try:
        lines = list(_lines(file.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"{file}: cannot be read: {error}") from error
    entries: dict[str, Entry] = {}
    for line in lines:
        if "request" in line:
            entries[line["id"]] = Entry(**line | {"images": tuple(line["images"])})
        elif line["id"] in entries:
            entries[line["id"]] = replace(
                entries[line["id"]], outcome=line["outcome"], note=line.get("note")
            )
    return list(entries.values())


def pictures_of(folder: Path, entry: Entry) -> tuple[Sequence[Path], Path | None]:
    """The files that went along with a request, and its mask."""
    place = folder / PICTURES
    return [
        place / name for name in entry.images
    ], None if entry.mask is None else place / entry.mask


def _lines(text: str) -> Iterator[dict[str, Any]]:
    for line in text.splitlines():
        try:
            read = json.loads(line)
        except ValueError:
            continue  # cut off when the recording process died
        if isinstance(read, dict) and "id" in read:
            yield read


def _validated(request: dict[str, Any]) -> JobRequest[Any]:
    try:
        return cast(JobRequest[Any], _REQUEST.validate_python(request))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"][1:]))
        raise RecordingError(
            f"a request of it is none for this version: {place}: {first['msg']}"
        ) from error
