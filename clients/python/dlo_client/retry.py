"""When a call is sent again.

Every call of the API may be repeated without harm: reads and cancel by nature, an upload because
the same bytes give the same id, a submission because it carries an ``Idempotency-Key``. What is
repeated is what may pass: a broken connection, and a 429 or 503 that states when to come back.
"""

from __future__ import annotations

from dataclasses import dataclass
from http import HTTPStatus

import httpx

Outcome = httpx.Response | httpx.RequestError

_MAY_PASS = (httpx.TimeoutException, httpx.NetworkError, httpx.RemoteProtocolError)
_COME_BACK = (HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE)


@dataclass(frozen=True, slots=True)
class RetryPolicy:
    """``attempts`` in all; the pause after a broken connection doubles, from ``first_pause_s`` on.

    A ``Retry-After`` longer than ``longest_pause_s`` is not waited for: the caller gets the
    refusal.
    """

    attempts: int = 4
    first_pause_s: float = 0.25
    longest_pause_s: float = 20.0

    def pause_s(self, attempt: int, outcome: Outcome) -> float | None:
        """Seconds until the next attempt after the ``attempt``-th (from 1), None when there is
        none."""
        if attempt >= self.attempts:
            return None
        if isinstance(outcome, httpx.Response):
            return self._asked_pause_s(outcome)
        if isinstance(outcome, _MAY_PASS):
            return min(self.first_pause_s * 2.0 ** (attempt - 1), self.longest_pause_s)
        return None

    def _asked_pause_s(self, response: httpx.Response) -> float | None:
        if response.status_code not in _COME_BACK:
            return None
        asked_s = retry_after_s(response)
        return asked_s if asked_s is not None and asked_s <= self.longest_pause_s else None


def retry_after_s(response: httpx.Response) -> float | None:
    """``Retry-After`` in seconds; None when missing or given as a date, which this service never
    does."""
    value = response.headers.get("Retry-After", "")
    return float(value) if value.isdecimal() else None
