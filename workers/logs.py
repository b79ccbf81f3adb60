"""Log lines as JSON on standard error, RQ's too."""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Callable

import structlog


def configure(level: str) -> None:
    """To be called once by a program, never by a library."""
    shared: list[structlog.types.Processor] = [
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.stdlib.add_logger_name,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
        structlog.processors.format_exc_info,
    ]
    structlog.configure(
        processors=[
            structlog.stdlib.filter_by_level,
            *shared,
            structlog.stdlib.ProcessorFormatter.wrap_for_formatter,
        ],
        logger_factory=structlog.stdlib.LoggerFactory(),
        cache_logger_on_first_use=True,
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=shared,
            processors=[
                structlog.stdlib.ProcessorFormatter.remove_processors_meta,
                structlog.processors.JSONRenderer(),
            ],
        )
    )
    handler.addFilter(Bounded())
    logging.basicConfig(level=level, handlers=[handler], force=True)
    logging.getLogger("rq").setLevel(logging.WARNING)
    for name in (
        "uvicorn",
        "uvicorn.error",
    ):  # started by its own command it has handlers of its own
        logging.getLogger(name).handlers.clear()
        logging.getLogger(name).propagate = True


class Bounded(logging.Filter):
    """Leaves out what is logged again and again: a service short of descriptors wrote 41 MB of the
    same warning.

    Of warnings and errors of one logger and text at most ``most`` pass in ``window_s``; the next
    window's first one states how many were left out.
    """

    _MOST_TEXTS = 1000

    def __init__(
        self, most: int = 20, window_s: float = 10.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        super().__init__()
        self._most = most
        self._window_s = window_s
        self._clock = clock
        self._lock = threading.Lock()
        self._seen: dict[tuple[str, int, str], tuple[float, int]] = {}
        """Start of the window, and how many since."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether it passes."""
        if record.levelno < logging.WARNING:
            return True
        event = record.msg.get("event", "") if isinstance(record.msg, dict) else record.msg
        key = (record.name, record.levelno, str(event)[:200])
        with self._lock:
            left_out = self._count(key)
        if left_out is None:
            return False
        if left_out:
            _add(record, left_out)
        return True

    def _count(self, key: tuple[str, int, str]) -> int | None:
        """None if it is to be left out; else how many were before it."""
        now = self._clock()
        if len(self._seen) > self._MOST_TEXTS:
            self._seen.clear()
        since, number = self._seen.get(key, (now, 0))
        if now - since >= self._window_s:
            self._seen[key] = now, 1
            return max(0, number - self._most)
        self._seen[key] = since, number + 1
        return 0 if number < self._most else None


def _add(record: logging.LogRecord, left_out: int) -> None:
    if isinstance(record.msg, dict):
        record.msg["left_out_before"] = left_out
    else:
        record.msg, record.args = (
            f"{record.getMessage()} ({left_out} more were left out before)",
            None,
        )
