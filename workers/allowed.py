"""Which queue entries a worker runs: those that name :data:`workers.dispatch.RUN` with their own
id, no others.

The JSON serializer alone is not safe: an entry is free to name any function of any module.
"""

from __future__ import annotations

from typing import Any, cast

import redis
from rq.exceptions import NoSuchJobError
from rq.job import Job

from workers.dispatch import RUN


class AllowedJob(Job):
    """A queue entry that states in ``refusal`` why it must not run, instead of upsetting the
    worker."""

    refusal: str | None = None

    @classmethod
    def fetch(
        cls,
        id: str,  # noqa: A002
        connection: redis.Redis | None = None,
        serializer: Any = None,
    ) -> AllowedJob:
        """The entry; NoSuchJobError, over which RQ passes, also for what is no entry at all."""
        try:
            return cast(AllowedJob, super().fetch(id, connection=connection, serializer=serializer))
        except (ValueError, TypeError, redis.ResponseError) as error:
            raise NoSuchJobError(f"not a queue entry: {error}") from error

    def refresh(self) -> None:
        """Read of the entry only what it calls; RQ would go through twenty fields that nobody asks
        for."""
        data = self.connection.hget(self.key, "data")
        if data is None:
            raise NoSuchJobError(f"no such entry: {self.key}")
        self.restore({b"data": data})

    def restore(self, raw_data: Any) -> None:
        """Called by RQ with what is in the queue server."""
        try:
            super().restore(raw_data)
            if (self.func_name, self.instance, list(self.args), self.kwargs) != (
                RUN,
                None,
                [self.id],
                {},
            ):
                self.refusal = f"it calls {self.func_name!r}"
        except NoSuchJobError:
            raise
        except Exception as error:  # whatever a forged entry provokes
            self.refusal = f"it cannot be read: {error!r}"
