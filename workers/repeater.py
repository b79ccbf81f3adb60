"""Something small to be done again and again beside the work."""

from __future__ import annotations

import threading
from collections.abc import Callable

import redis
import structlog

log = structlog.get_logger(__name__)


class Repeater:
    """Calls ``action`` at once, then every ``interval_s``, in a thread, whether or not the queue
    answers."""

    def __init__(self, name: str, interval_s: float, action: Callable[[], object]) -> None:
        self._name = name
        self._interval_s = interval_s
        self._action = action
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._repeat, name=name, daemon=True)

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Return once no call is under way."""
        self._stopped.set()
        if self._thread.is_alive():
            self._thread.join()

    def _repeat(self) -> None:
        while True:
            try:
                self._action()
            except (redis.RedisError, OSError) as error:
                log.warning("upkeep has to wait", upkeep=self._name, error=str(error))
            except Exception:  # a worker that works but is silent would be worse
                log.exception("upkeep failed", upkeep=self._name)
            if self._stopped.wait(self._interval_s):
                return
