"""Server-sent events of a job, line by line, and where the stream stands when it breaks."""

from __future__ import annotations

import httpx
from pydantic import ValidationError

from dlo_client.contracts import JobEvent
from dlo_client.errors import UnexpectedReply


class EventCursor:
    """Turns lines into events and remembers the last one, for ``Last-Event-ID``.

    ``breaks`` counts the broken streams since the last event: a stream that makes progress may
    break often.
    """

    def __init__(self) -> None:
        self.last_id: str | None = None
        self.ended = False
        self.breaks = 0
        self._data: list[str] = []

    def feed(self, line: str) -> JobEvent | None:
        """The event that ``line`` completes (a blank line ends one), else None. Comments are
        pings."""
        if line:
            self._collect(line)
            return None
        data, self._data = "\n".join(self._data), []
        return self._advance(data) if data else None

    def broken(self) -> int:
        """The stream ended early: drop the half event. Returns how often this happened without
        progress."""
        self._data = []
        self.breaks += 1
        return self.breaks

    def check_end(self, response: httpx.Response) -> None:
        """Raise as for a broken connection when ``response`` ended before the job did."""
        if not self.ended:
            raise httpx.RemoteProtocolError(
                "the stream ended before the job did", request=response.request
            )

    def _collect(self, line: str) -> None:
        name, _, value = line.partition(":")
        if name == "data":
            self._data.append(value.removeprefix(" "))

    def _advance(self, data: str) -> JobEvent:
        try:
            event = JobEvent.model_validate_json(data)
        except ValidationError as error:
            raise UnexpectedReply(f"not an event of a job: {error}") from error
        self.last_id = event.id
        self.ended = event.state.final
        self.breaks = 0
        return event
