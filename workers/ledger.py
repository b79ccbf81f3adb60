"""The states of a job and the only steps between them.

Strategy: each step is one script inside the queue server, hence atomic: it looks at the state (and,
for a running job, at the number of the attempt), and does nothing unless the step is allowed from
there. So of two that race — a cancel and a success, a reaper and a slow worker — the first wins and
the other is told.

    queued ──claim──► running ──end──► succeeded | failed | cancelled
      ▲                  │
      └── lost, reap ────┘            queued ──end──► failed (too late, refused) | cancelled

The scripts name keys that are not declared to the server: a Redis cluster is not supported.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Literal, cast

import redis
from dlo_client.contracts import Contract, FileRef, JobState, Problem
from dlo_client.contracts.frames import RobotPoses

from workers import problems
from workers.admission import Terms
from workers.dispatch import Argument, Dispatch, RqDispatch
from workers.record import Entry, Origin
from workers.settings import Settings
from workers.steps import scripts

ALIVE_MS = 5000
"""A running job whose worker is silent for so long is taken for lost …"""

GRACE_MS = 1500
"""… if it is still silent so much later: right after a restart of the queue server all of them
are."""

Hold = Literal["held", "wanted", "ended", "gone"]
"""How a claim stands: its job runs, it runs although it is of batch and an interactive one waits,
this attempt has ended it, or it was cancelled or taken over."""


@dataclass(frozen=True)
class Claim:
    """The right to run a job once: held until the job's ``attempt`` is over or another began."""

    job_id: str
    attempt: int
    request: str
    """JSON of the request, if it is not in a blob."""
    remaining_s: float
    """Until the deadline, when the claim was made."""
    queue_wait_ms: float
    request_blob: str = ""
    """Id of the blob with the JSON of a large request."""
    request_id: str = ""
    traceparent: str = ""
    owner: str = ""
    """See :class:`workers.record.Origin`."""


@dataclass(frozen=True)
class Opening:
    """The step that begins a job's record, to be taken with a client of either kind."""

    job_id: str
    terms: Terms
    script: str
    arguments: list[Argument]

    def known(self, answer: Any) -> str | None:
        """The job that the idempotency key already stands for, by what the script answered; None if
        this one is new.

        Raises:
            QueueFull: there is no room for it.
            IdempotencyConflict: the key stands for another request.
        """
        return self.terms.known_job(answer)


class Ledger:
    """The steps of a job's record, over one client of the queue server."""

    def __init__(
        self, client: redis.Redis, settings: Settings, dispatch: Dispatch | None = None
    ) -> None:
        """``dispatch``: RQ's unless another is given."""
        self.dispatch = dispatch or RqDispatch(client, settings.keys)
        self._settings = settings
        self._settings_arguments = (
            round(settings.result_ttl_s * 1000),
            round(settings.tombstone_ttl_s * 1000),
            settings.max_attempts,
            problems.deadline_exceeded().model_dump_json(),
            problems.worker_lost().model_dump_json(),
        )
        self._texts = scripts(settings.keys, self.dispatch.script)
        self._scripts = {name: client.register_script(text) for name, text in self._texts.items()}

    def admit(self, terms: Terms) -> str | None:
        """The job that the idempotency key stands for, None if there is room for one; raises as
        :meth:`open`."""
        return terms.known_job(self._step("admit", "", *terms.arguments()))

    def open(self, opening: Opening) -> str | None:
        """Begin a record and put its id into a queue; or the job that the idempotency key already stands for. Raises as
        :meth:`Opening.known`."""
        return opening.known(self._scripts["open"](args=opening.arguments))

    def opening(
        self,
        job_id: str,
        entry: Entry,
        terms: Terms,
        *,
        request_blob: str = "",
        origin: Origin = Origin(),  # noqa: B008 (frozen)
    ) -> Opening:
        """The step for :meth:`open`; the request is in the blob ``request_blob``, or in the record
        without one."""
        known = (terms.digest, round(self._settings.idempotency_ttl_s * 1000))
        texts = (entry.kind, entry.priority, entry.label or "")
        request = "" if request_blob else entry.request
        more = (entry.timeout_s, request, entry.webhook_url or "", request_blob)
        came = (origin.request_id, origin.traceparent, entry.recipe)
        engine = self.dispatch.arguments(job_id, entry.priority)
        arguments = self._arguments(
            job_id, *terms.arguments(), *known, *texts, *more, *came, *engine
        )
        return Opening(job_id, terms, self._texts["open"], arguments)

    def claim(self, job_id: str, worker: str) -> Claim | None:
        """Make a queued job running; None if it is not queued, or too late (it then has failed)."""
        answer = self._step("claim", job_id, worker, ALIVE_MS)
        if answer is None:
            return None
        attempt, request, remaining_s, waited_s, *rest = answer
        return Claim(
            job_id, int(attempt), request, float(remaining_s), float(waited_s) * 1000, *rest
        )

    def renew(self, claim: Claim, worker: str, stood_s: float = 0.0) -> Hold:
        """Write down that the job is still being worked on, if the claim is held.

        ``stood_s``: seconds that it stood still meanwhile for another one; its deadline comes so
        much later.
        """
        return cast(
            Hold, self._step("renew", claim.job_id, claim.attempt, worker, ALIVE_MS, stood_s)
        )

    def progress(self, claim: Claim, fraction: float) -> None:
        self._step("progress", claim.job_id, claim.attempt, f"{fraction:.4f}")

    def succeed(
        self,
        claim: Claim,
        result: Contract,
        files: list[FileRef],
        timings_ms: dict[str, float],
        poses: RobotPoses | None = None,
    ) -> bool:
        """End a job well; False if the claim is no longer held, and nothing has changed."""
        fields = {
            "result": result.model_dump_json(),
            "files": json.dumps([file.model_dump() for file in files]),
            "timings_ms": json.dumps(timings_ms),
            "progress": "1",
        }
        if poses is not None:
            fields["poses"] = poses.model_dump_json()
        return self._end(claim.job_id, claim.attempt, JobState.SUCCEEDED, fields)

    def fail(self, claim: Claim, problem: Problem) -> bool:
        """End a job badly; False if the claim is no longer held, and nothing has changed."""
        return self._end(
            claim.job_id, claim.attempt, JobState.FAILED, {"problem": problem.model_dump_json()}
        )

    def fail_queued(self, job_id: str, problem: Problem) -> bool:
        """End a job that never ran."""
        return self._end(job_id, "", JobState.FAILED, {"problem": problem.model_dump_json()})

    def cancel(self, job_id: str) -> None:
        """Cancel, unless the job is over; its worker sees that its claim is gone and stops."""
        self._step("cancel", job_id)

    def lost(self, claim: Claim) -> str | None:
        """The worker's child died: try the job again, or fail it. Says which; None if the claim was
        gone."""
        return cast(str | None, self._step("lost", claim.job_id, claim.attempt))

    def reap(self, job_id: str) -> str | None:
        """Put right what nobody works on any more; states what was done, if anything."""
        return cast(str | None, self._step("reap", job_id, GRACE_MS))

    def _end(
        self, job_id: str, attempt: int | str, state: JobState, fields: dict[str, str]
    ) -> bool:
        pairs = [part for pair in fields.items() for part in pair]
        return bool(self._step("end", job_id, attempt, state.value, *pairs))

    def _step(self, name: str, job_id: str, *arguments: Argument) -> Any:
        return self._scripts[name](args=self._arguments(job_id, *arguments))

    def _arguments(self, job_id: str, *more: Argument) -> list[Argument]:
        return [job_id, *self._settings_arguments, *more]
