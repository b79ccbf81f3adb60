"""Every environment variable that the queue and the workers read; the HTTP ones are in
services.settings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, PositiveFloat, PositiveInt, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from workers.keys import Keys

LONGEST_JOB_S = 3600.0
"""Upper bound of ``JobRequest.timeout_s``."""


def comma_separated(value: object) -> object:
    """The parts of a variable that lists texts; anything else as it is."""
    if isinstance(value, str):
        return tuple(part.strip() for part in value.split(",") if part.strip())
    return value


class Settings(BaseSettings):
    """Read from ``DLO_*``; durations in seconds."""

    model_config = SettingsConfigDict(env_prefix="DLO_", frozen=True)

    redis_url: str = Field(
        default="redis://127.0.0.1:6379/0",
        repr=False,
        description="redis:// or, with TLS, rediss://; may name a user",
    )
    redis_password_file: Path | None = Field(
        default=None, description="instead of a password in redis_url"
    )
    redis_ca_file: Path | None = Field(
        default=None,
        description="PEM of the authorities that sign the queue server; by default the system's",
    )
    queue_prefix: str = Field(
        default="dlo",
        pattern="^[a-z0-9][a-z0-9_-]{0,31}$",
        description="of all keys: one a deployment on a server",
    )
    data_dir: Path = Field(
        default=Path("data"), description="holds blobs/, networks/ and the embedded queue's queue/"
    )
    log_level: str = Field(default="INFO", pattern="^(DEBUG|INFO|WARNING|ERROR)$")

    result_ttl_s: PositiveFloat = Field(default=3600.0, description="a job's record after its end")
    tombstone_ttl_s: PositiveFloat = Field(
        default=86_400.0, description="410 is answered this long after that"
    )
    idempotency_ttl_s: PositiveFloat = 86_400.0
    blob_ttl_s: PositiveFloat = Field(
        default=86_400.0, description="since a blob was last put or touched"
    )

    blobs_url: str = Field(
        default="",
        pattern=r"^(s3://[a-z0-9][a-z0-9.-]{1,61}[a-z0-9](/[A-Za-z0-9._/-]*)?)?$",
        description="s3://bucket or s3://bucket/folder; by default a folder in data_dir",
    )
    disk_reserve_bytes: int = Field(
        default=1024**3,
        ge=0,
        description="uploads leave so much of the disk free, results half of it",
    )

    max_queue_depth: PositiveInt = 1000
    max_queue_bytes: PositiveInt = Field(
        default=2 * 1024**3,
        description="memory of the queue server above which nothing more is accepted",
    )
    batch_share: float = Field(
        default=0.1,
        ge=0,
        le=0.5,
        description="share of its jobs that a worker takes from batch while interactive waits",
    )
    preempt: bool = Field(
        default=True,
        description="a batch job stands still while its worker runs an interactive one; needs spare_child",
    )
    max_tracks: PositiveInt = Field(
        default=1000, description="kept at a time; a new one is refused then"
    )
    track_ttl_s: PositiveFloat = Field(
        default=3600.0, description="a track is forgotten so long after its last frame"
    )
    max_attempts: PositiveInt = Field(
        default=2, description="times a job whose worker dies is taken up"
    )
    max_images_per_job: PositiveInt = 64
    max_image_bytes: PositiveInt = 32 * 1024 * 1024
    max_image_pixels: PositiveInt = 64_000_000
    max_network_bytes: PositiveInt = Field(
        default=128 * 1024 * 1024, description="of the file of a network"
    )
    max_labels_bytes: PositiveInt = Field(
        default=256 * 1024 * 1024, description="of an archive of labelled pictures"
    )
    unsure_pictures: int = Field(
        default=100,
        ge=0,
        description="kept for each API key, of requests that allow it; see keep_if_unsure",
    )
    default_model: str = Field(
        default="",
        description="foreground network for requests that name none; default: the shipped one",
    )

    workers: PositiveInt = Field(default=1, description="on this machine; they share its cores")
    training_workers: int = Field(
        default=0,
        ge=0,
        description="of those that adapt networks, beside them; they need requirements/training.txt",
    )
    onnx_providers: list[str] = ["CPUExecutionProvider"]
    onnx_threads: int = Field(default=0, ge=0, description="a session; 0 = cores // workers")
    recycle_after_jobs: PositiveInt = Field(
        default=2000, description="then the warm child is replaced"
    )
    child_memory_mb: int = Field(
        default=0,
        ge=0,
        description="a job that needs more fails as too_large; 0 = 3/4 of the memory // workers",
    )
    spare_child: bool = Field(
        default=True, description="keep the next warm child ready: no pauses, twice the memory"
    )
    recycle_rss_mb: PositiveInt = Field(
        default=4096, description="a larger warm child is replaced after its job"
    )

    webhook_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="hosts (or host:port) that a webhook_url may name, separated by commas; none by default",
    )
    webhook_secret: str = Field(
        default="", repr=False, description="signs webhooks; at least 16 characters"
    )

    @property
    def keys(self) -> Keys:
        """Names in the queue server."""
        return Keys(self.queue_prefix)

    @property
    def blobs_dir(self) -> Path:
        return self.data_dir / "blobs"

    @property
    def training_dir(self) -> Path:
        """Of what trainings have done so far, for those that are cut off."""
        return self.data_dir / "training"

    @property
    def queue_dir(self) -> Path:
        return self.data_dir / "queue"

    @field_validator("webhook_hosts", mode="before")
    @classmethod
    def _split_hosts(cls, value: object) -> object:
        return comma_separated(value)

    @field_validator("redis_password_file", "redis_ca_file", mode="before")
    @classmethod
    def _empty_is_none(cls, value: object) -> object:
        """So that a compose file can name a variable that is not set."""
        return value or None

    @model_validator(mode="after")
    def _webhooks_are_signed(self) -> Settings:
        if self.webhook_hosts and len(self.webhook_secret) < 16:
            raise ValueError(
                "DLO_WEBHOOK_HOSTS needs a DLO_WEBHOOK_SECRET of at least 16 characters"
            )
        return self

    @model_validator(mode="after")
    def _blobs_outlive_their_jobs(self) -> Settings:
        longest_s = (
            2 * LONGEST_JOB_S
        )  # of a job that stands still meanwhile for others, see preempt
        if self.blob_ttl_s < longest_s + self.result_ttl_s:
            raise ValueError(f"DLO_BLOB_TTL_S must be at least {longest_s:g} + DLO_RESULT_TTL_S")
        return self
