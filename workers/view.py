"""What is known of jobs, queues and workers: the half of the queue's door that changes nothing."""

from __future__ import annotations

from typing import cast

import redis
from dlo_client.contracts import AnyJob, JobEvent, JobKind, JobPage, JobState, NetworkInfo

from workers.connection import connect
from workers.listing import recent_page
from workers.measures import Measures
from workers.presence import WorkerInfo, present
from workers.reading import absent, bounded_block, events_of, stream_after
from workers.record import ALL_QUEUES, TRAINING, read_job
from workers.settings import Settings


class QueueView:
    """Every method raises ``redis.RedisError`` when the queue server does not answer."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._keys = settings.keys
        self._client = connect(settings)

    def get(self, job_id: str) -> AnyJob:
        """The job; raises JobUnknown or JobGone."""
        record = cast(dict[str, str], self._client.hgetall(self._keys.job(job_id)))
        if not record:
            raise absent(self._client.exists(self._keys.tombstone(job_id)), job_id)
        return read_job(record)

    def request(self, job_id: str) -> str | None:
        """JSON of the job's request; None once it has ended, if it was long or the record is
        gone."""
        return cast(str | None, self._client.hget(self._keys.job(job_id), "request")) or None

    def events(self, job_id: str, after: str = "0", block_ms: int = 0) -> list[JobEvent]:
        """The job's events after the event id ``after``; anything that is not such an id means all
        of them.

        Waits up to ``block_ms`` (at most ``LONGEST_BLOCK_MS``) for the first; none is an empty
        list. Raises JobUnknown or JobGone.
        """
        answer = self._client.xread(
            *stream_after(self._keys, job_id, after), block=bounded_block(block_ms)
        )
        if not answer and not self._client.exists(self._keys.job(job_id)):
            raise absent(self._client.exists(self._keys.tombstone(job_id)), job_id)
        return events_of(answer)

    def recent(
        self,
        *,
        limit: int = 50,
        cursor: str | None = None,
        state: JobState | None = None,
        kind: JobKind | None = None,
        owner: str | None = None,
    ) -> JobPage:
        """Jobs (of ``owner``, if given) newest first, without their results. ValueError on a cursor
        that is none."""
        return recent_page(
            self._client,
            self._keys,
            limit=limit,
            cursor=cursor,
            state=state,
            kind=kind,
            owner=owner,
        )

    def workers(self) -> list[WorkerInfo]:
        """The live workers."""
        return present(self._client, self._keys)

    def trains(self) -> bool:
        """Whether a live worker takes what waits for training."""
        return any(TRAINING in worker.queues for worker in self.workers())

    def networks(self) -> list[NetworkInfo]:
        """What the live, ready workers have, each network once."""
        there = (
            network for worker in self.workers() if worker.ready for network in worker.networks
        )
        return list({(network.name, network.version): network for network in there}.values())

    def foreground_networks(self) -> list[str]:
        """Names that a request's ``model`` may take; empty as long as no live worker has announced
        any."""
        there = (network for worker in self.workers() for network in worker.networks)
        return sorted({network.name for network in there if network.task == "foreground"})

    def depth(self) -> dict[str, int]:
        """Jobs that wait, by queue."""
        with self._client.pipeline(transaction=False) as pipeline:
            for name in ALL_QUEUES:
                pipeline.zcard(self._keys.waiting(name))
            return dict(zip(ALL_QUEUES, pipeline.execute(), strict=True))

    def oldest_s(self) -> dict[str, float]:
        """How long the job that waits longest has waited, by queue; 0 where none waits."""
        with self._client.pipeline(transaction=False) as pipeline:
            pipeline.time()
            for name in ALL_QUEUES:
                pipeline.zrange(self._keys.waiting(name), 0, 0, withscores=True)
            (seconds, micros), *oldest = pipeline.execute()
        now = seconds + micros / 1e6
        ages = [max(0.0, now - float(found[0][1])) if found else 0.0 for found in oldest]
        return dict(zip(ALL_QUEUES, ages, strict=True))

    def counts(self) -> dict[tuple[str, str], int]:
        """How many jobs of each kind have ever entered each state; every job enters ``queued``,
        once."""
        counted = {}
        for name, number in cast(dict[str, str], self._client.hgetall(self._keys.counts)).items():
            kind, state = name.split("|")
            counted[kind, state] = int(number)
        return counted

    def measures(self) -> Measures:
        """What else is counted of jobs."""
        return Measures.read(cast(dict[str, str], self._client.hgetall(self._keys.measures)))

    def server_bytes(self) -> int:
        """Memory that the queue server has taken."""
        return int(self._client.info("memory")["used_memory"])

    def ping(self) -> bool:
        """Whether the queue server answers."""
        try:
            return bool(self._client.ping())
        except redis.RedisError:
            return False

    def close(self) -> None:
        self._client.close()
