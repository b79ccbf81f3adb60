"""The part of the queue's door that waits, for an event loop: hundreds of waiters need no
threads."""

from __future__ import annotations

from typing import cast

from dlo_client.contracts import JobEvent
from redis.commands.core import AsyncScript

from workers import quota
from workers.connection import LONGEST_BLOCK_MS, connect_async
from workers.ledger import Opening
from workers.reading import absent, bounded_block, events_of, stream_after
from workers.record import JobRecord
from workers.settings import Settings


class AsyncJobQueue:
    """Twin of :class:`workers.queue.JobQueue`."""

    def __init__(self, settings: Settings) -> None:
        self._client = connect_async(settings)
        self._keys = settings.keys
        self._pace = self._client.register_script(quota.PACE)
        self._opens: dict[str, AsyncScript] = {}

    async def open(self, opening: Opening) -> str:
        """Put the job into the queue; its id, or that of the one for which its idempotency key
        already stands. Raises as :meth:`workers.ledger.Opening.known`."""
        script = self._opens.get(opening.script) or self._client.register_script(opening.script)
        self._opens[opening.script] = script
        return opening.known(await script(args=opening.arguments)) or opening.job_id

    async def get(self, job_id: str) -> JobRecord:
        """See :meth:`workers.view.QueueView.get`."""
        return await self._read(
            job_id, cast(dict[str, str], await self._client.hgetall(self._keys.job(job_id)))
        )

    async def when_ended(self, job_id: str, block_ms: int) -> JobRecord:
        """The job as soon as it has ended, or as it stands after ``block_ms``. Raises JobUnknown or
        JobGone.

        One trip: on a connection the server looks at the record only once it is through with the
        blocking read.
        """
        async with self._client.pipeline(transaction=False) as pipeline:
            pipeline.xread(
                {self._keys.ended(job_id): "0"}, block=max(1, min(block_ms, LONGEST_BLOCK_MS))
            )
            pipeline.hgetall(self._keys.job(job_id))
            _, record = await pipeline.execute()
        return await self._read(job_id, record)

    async def events(self, job_id: str, after: str = "0", block_ms: int = 0) -> list[JobEvent]:
        """See :meth:`workers.view.QueueView.events`."""
        answer = await self._client.xread(
            *stream_after(self._keys, job_id, after), block=bounded_block(block_ms)
        )
        if not answer and not await self._client.exists(self._keys.job(job_id)):
            raise absent(await self._client.exists(self._keys.tombstone(job_id)), job_id)
        return events_of(answer)

    async def _read(self, job_id: str, record: dict[str, str]) -> JobRecord:
        if not record:
            raise absent(await self._client.exists(self._keys.tombstone(job_id)), job_id)
        return JobRecord.read(record)

    async def pace(self, owner: str, per_minute: int) -> float:
        """Seconds that ``owner`` has to wait before its next request; 0 for one that may go on, and
        counts."""
        return float(await self._pace(keys=[self._keys.pace(owner)], args=[per_minute]))

    async def close(self) -> None:
        await self._client.aclose()
