"""``/v1/webhooks``: those that were given up, for an operator."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated

from fastapi import APIRouter, Path
from pydantic import BaseModel, Field

from services import documents
from services.access import Admin, BackendDep
from services.problems import ProblemError

router = APIRouter(prefix="/v1/webhooks", tags=["webhooks"])


class DeadLetterInfo(BaseModel):
    """A webhook that was given up: the job it is about, where it went, and what came of its last
    attempt."""

    job_id: str = Field(description="the job that had ended")
    url: str = Field(description="its `webhook_url`")
    error: str = Field(description="why the last attempt failed")
    given_up_at: datetime = Field(description="when that was")


@router.get("/dead", responses=documents.problems(403, 429))
def list_dead(_: Admin, backend: BackendDep) -> list[DeadLetterInfo]:
    """The webhooks that were given up within a week, newest first."""
    return [
        DeadLetterInfo(
            job_id=letter.job_id,
            url=letter.url,
            error=letter.error,
            given_up_at=datetime.fromtimestamp(letter.given_up_at, UTC),
        )
        for letter in backend.queue.dead_letters.all()
    ]


@router.post("/dead/{job_id}/resend", status_code=202, responses=documents.problems(403, 404, 429))
def resend(
    job_id: Annotated[str, Path(description="as in the list")], _: Admin, backend: BackendDep
) -> None:
    """Deliver one of them anew."""
    if not backend.queue.dead_letters.resend(job_id):
        raise ProblemError(
            404, "unknown_webhook", "no webhook of this job was given up, or it is no longer kept"
        )
