"""How a finished job ended: its result, or the error that states why there is none."""

from __future__ import annotations

from typing import Any, overload

from dlo_client.contracts import Job, JobState
from dlo_client.contracts.base import ResultT
from dlo_client.errors import JobCancelled, JobFailed, UnexpectedReply


def succeeded(job: Job[ResultT]) -> Job[ResultT]:
    """The job itself when it succeeded; raises JobFailed or JobCancelled."""
    if job.state is JobState.CANCELLED:
        raise JobCancelled(job)
    if job.problem is not None:
        raise JobFailed(job, job.problem)
    return job


@overload
def result_of(job: Job[ResultT]) -> ResultT: ...
@overload
def result_of(job: ResultT) -> ResultT: ...
def result_of(job: Any) -> Any:
    """The result of a finished job, never None; raises JobFailed or JobCancelled. A result is
    returned as it is."""
    if not isinstance(job, Job):
        return job
    result = succeeded(job).result
    if result is None:
        raise UnexpectedReply(f"job {job.id} is {job.state} and has no result")
    return result
