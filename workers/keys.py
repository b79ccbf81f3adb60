"""Names of everything that a deployment keeps in the queue server, under its prefix
(``DLO_QUEUE_PREFIX``)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass


@dataclass(frozen=True)
class Keys:
    """Names under one prefix."""

    prefix: str

    @property
    def active(self) -> str:
        """Set of the ids of all jobs that are queued or running."""
        return f"{self.prefix}:active"

    @property
    def recent(self) -> str:
        """Sorted set of job ids by their running number."""
        return f"{self.prefix}:recent"

    @property
    def webhooks(self) -> str:
        """Sorted set of the ids of ended jobs whose webhook has not been heard, by the time of the
        next attempt."""
        return f"{self.prefix}:webhooks"

    @property
    def dead_letters(self) -> str:
        """Sorted set of the ids of jobs whose webhook was given up, by the time at which that
        was."""
        return f"{self.prefix}:dead_letters"

    @property
    def counts(self) -> str:
        """Hash of ``kind|state`` to how many jobs have ever entered that state."""
        return f"{self.prefix}:counts"

    @property
    def measures(self) -> str:
        """Hash of everything else that is counted, see workers.measures."""
        return f"{self.prefix}:measures"

    @property
    def workers(self) -> str:
        """Set of the names of workers that have announced themselves."""
        return f"{self.prefix}:workers"

    @property
    def blobs(self) -> str:
        """Mark of the place that holds the pictures, see workers.shared_blobs."""
        return f"{self.prefix}:blobs"

    @property
    def outsider(self) -> str:
        """Why a worker that is there does not join; expires unless it is set again."""
        return f"{self.prefix}:outsider"

    @property
    def reaping(self) -> str:
        """Lock of a reaper's pass."""
        return f"{self.prefix}:reaping"

    def job(self, job_id: str) -> str:
        """Hash of a job's record."""
        return f"{self.prefix}:job:{job_id}"

    def events(self, job_id: str) -> str:
        """Stream of a job's states and progress."""
        return f"{self.prefix}:events:{job_id}"

    def ended(self, job_id: str) -> str:
        """Stream of one entry, for a moment after a job's end: whoever waits for that is woken by
        nothing else."""
        return f"{self.prefix}:ended:{job_id}"

    def tombstone(self, job_id: str) -> str:
        """There as long as a job that is gone is remembered."""
        return f"{self.prefix}:tombstone:{job_id}"

    def alive(self, job_id: str) -> str:
        """There as long as somebody works on the job."""
        return f"{self.prefix}:alive:{job_id}"

    @property
    def tracks(self) -> str:
        """Sorted set of the ids of all tracks by the time at which they expire."""
        return f"{self.prefix}:tracks"

    def track(self, track_id: str) -> str:
        """Hash of a track."""
        return f"{self.prefix}:track:{track_id}"

    def track_held(self, track_id: str) -> str:
        """There as long as a frame of the track is looked at."""
        return f"{self.prefix}:track_held:{track_id}"

    def owned(self, owner: str) -> str:
        """Set of the ids of an owner's jobs that are queued or running."""
        return f"{self.prefix}:owned:{owner}"

    def waiting(self, priority: str) -> str:
        """Sorted set of the ids of queued jobs by the time at which they were submitted."""
        return f"{self.prefix}:waiting:{priority}"

    def turns(self, priority: str) -> str:
        """Sorted set of the ids of jobs in a queue by their turn, see workers.dispatch."""
        return f"{self.prefix}:turns:{priority}"

    def last_turns(self, priority: str) -> str:
        """Hash of an owner to the turn of its last job; of a blank to the turn of the job last
        taken."""
        return f"{self.prefix}:last_turns:{priority}"

    def worker(self, name: str) -> str:
        """A worker's announcement."""
        return f"{self.prefix}:worker:{name}"

    def dead_letter(self, job_id: str) -> str:
        """Hash of a webhook that was given up."""
        return f"{self.prefix}:dead_letter:{job_id}"

    def pace(self, owner: str) -> str:
        """When an owner's next request is due."""
        return f"{self.prefix}:pace:{owner}"

    def stored(self, owner: str) -> tuple[str, str]:
        """The blobs of an owner: by the time at which they were last charged, and their sizes."""
        return f"{self.prefix}:stored:{owner}", f"{self.prefix}:stored:{owner}:bytes"

    def idempotency(self, given: str, owner: str) -> str:
        """The job that an idempotency key stands for; two owners may use the same key."""
        return (
            f"{self.prefix}:idempotency:{hashlib.sha256(f'{owner}|{given}'.encode()).hexdigest()}"
        )

    def shelf(self, sort: str) -> str:
        """Hash of the names of kept documents of a sort (``recipes``, ``cameras``) to their latest
        versions."""
        return f"{self.prefix}:{sort}"

    def shelved(self, sort: str, name: str) -> str:
        """Hash of the versions of a kept document, see workers.kept."""
        return f"{self.prefix}:{sort}:{name}"

    def queue(self, priority: str) -> str:
        """Name of the queue of a priority, as RQ is given it."""
        return f"{self.prefix}:{priority}"
