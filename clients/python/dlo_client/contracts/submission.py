"""What the requests and results of every kind share."""

from __future__ import annotations

from typing import Generic, Literal, Self

from pydantic import Field, model_validator

from dlo_client.contracts.base import Contract, Reply, ResultT
from dlo_client.contracts.frames import Output

Priority = Literal["interactive", "batch"]
Queue = Literal["interactive", "batch", "training"]


class JobRequest(Contract, Generic[ResultT]):
    """What every request may carry; ``ResultT`` is what its job comes back with."""

    priority: Priority = Field(
        default="interactive", description="`interactive` jobs go before `batch` ones"
    )
    timeout_s: float = Field(
        default=60.0, gt=0, le=3600, description="from acceptance to the end of the job"
    )
    label: str | None = Field(default=None, max_length=200, description="echoed in the job")
    webhook_url: str | None = Field(
        default=None,
        max_length=2000,
        pattern=r"^https?://([A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\])(:\d{1,5})?(/\S*)?$",
        description="the ended job is POSTed there, signed; its host must be one that the service allows",
    )
    output: Output | None = Field(
        default=None,
        description="states the places of the answer as robot poses, in the job's `poses`",
    )

    @model_validator(mode="after")
    def _output_fits(self) -> Self:
        if self.output is not None:
            self.output.check_fits(
                str(getattr(self, "kind", "")), in_space=getattr(self, "depth", None) is not None
            )
        return self

    @property
    def queue(self) -> Queue:
        """That its job waits in."""
        return self.priority

    @property
    def needs_picture(self) -> bool:
        """Whether an ``image`` (or ``mask``) field of this kind has to name a picture."""
        return True


class ModelUsed(Reply):
    """Which network took part, and the first 12 digits of its file's SHA-256."""

    name: str = Field(description="as in `/v1/models`")
    version: str = Field(description="of the network")
    sha256: str = Field(description="first 12 digits of its file's SHA-256")
