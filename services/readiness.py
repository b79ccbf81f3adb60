"""Whether jobs would run now."""

from __future__ import annotations

from redis.exceptions import RedisError

from workers.queue import JobQueue
from workers.record import TRAINING


def hindrance(queue: JobQueue) -> str | None:
    """Why jobs would not run; None when the queue answers and a live worker has warmed its
    networks."""
    try:
        workers = queue.workers()
        apart, outsider = queue.apart(), queue.outsider()
    except RedisError:
        return "the queue cannot be reached"
    if apart:
        return apart
    if not any(worker.ready and worker.queues != [TRAINING] for worker in workers):
        return outsider or "no worker is ready yet"
    return None
