"""The child that works and the one that comes after it, so that replacing one makes nobody wait.

Strategy: a warm child may have to go at any moment: cancelled, killed, out of memory, worn. Loading
the networks takes seconds; hence the next one is loaded as soon as the first is warm, and stands
by. A worn child goes on until the next one is warm; only one that has died, or has no memory left,
leaves a worker without.
"""

from __future__ import annotations

from collections.abc import Callable

import structlog

from workers.child_process import ChildDied, ChildProcess
from workers.settings import Settings

_LOOK_S = 0.5
_TRIES = 2
"""A child that was killed while it loaded is started again; one that cannot load ends the
worker."""

log = structlog.get_logger(__name__)


class Children:
    """``current`` runs jobs. All methods from one thread that lives on."""

    def __init__(self, settings: Settings, turn: Callable[[], None]) -> None:
        """``turn`` is called again and again while a child is waited for."""
        self._settings = settings
        self._turn = turn
        self._next: ChildProcess | None = None
        self.current = ChildProcess(settings)

    def ready(self) -> None:
        """Return once the current child is warm; raises ChildDied if that cannot be."""
        if self.current.alive and self.current.ready:
            return
        self.current.kill()
        if self._next is not None:
            self.current, self._next = self._next, None
        for left in reversed(range(_TRIES)):
            try:
                self._load()
                break
            except ChildDied as error:
                if not left:
                    raise
                log.error("the child died while it warmed up; starting it again", error=str(error))
                self.current.kill()
        log.info("child warm")

    def _load(self) -> None:
        if not self.current.alive:
            self.current.begin()
        while not self.current.warm(_LOOK_S):
            self._turn()

    def tend(self) -> None:
        """Between jobs: see that the next child warms up, and let it take over from a worn one."""
        if self.current.spent or (self.current.worn and not self._settings.spare_child):
            self.current.kill()
        if not self._settings.spare_child:
            return
        if self._next is None:
            self._begin_next()
        elif self._warm(self._next) and self.current.worn:
            worn, self.current, self._next = self.current, self._next, None
            worn.kill()

    def standby(self) -> ChildProcess | None:
        """The next child, if it is warm and good for a job while the current one is at work."""
        if not self._settings.spare_child:
            return None
        if self._next is not None and (self._next.worn or self._next.spent):
            self._next.kill()
            self._next = None
        if self._next is None:
            self._begin_next()
        found = self._next
        return found if found is not None and self._warm(found) and found.alive else None

    def kill(self) -> None:
        """End both."""
        for child in (self.current, self._next):
            if child is not None:
                child.kill()

    def _begin_next(self) -> None:
        self._next = ChildProcess(self._settings)
        self._next.begin()

    def _warm(self, child: ChildProcess) -> bool:
        try:
            return child.warm()
        except ChildDied as error:
            log.error("the next child died while it warmed up; starting it again", error=str(error))
            child.kill()
            self._next = None
            return False
