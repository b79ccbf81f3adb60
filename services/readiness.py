"""Whether jobs would run now."""

from __future__ import annotations

from redis.exceptions import RedisError

from workers.queue import JobQueue


def hindrance(queue: JobQueue) -> str | None:
    """Why jobs would not run; None when the queue answers and a live worker has warmed its networks."""
    try:
        workers = queue.workers()
    except RedisError:
        return "the queue cannot be reached"
    if not any(worker.ready for worker in workers):
        return "no worker is ready yet"
    return None
