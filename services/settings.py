"""Settings of the HTTP service: those of the workers, and what only HTTP needs; ``DLO_*`` as
there."""

from __future__ import annotations

import ipaddress
import re
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, PositiveInt, field_validator, model_validator
from pydantic_settings import NoDecode

from workers.settings import Settings, comma_separated

MEBIBYTE = 1024 * 1024


class ServiceSettings(Settings):
    """What the service is told from outside; refuses to listen to a network without API keys."""

    host: str = "127.0.0.1"
    port: int = Field(default=8000, ge=0, le=65535, description="0 takes a free one")
    api_key_hashes: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(), description="SHA-256 of each API key, lower-case hex, separated by commas"
    )
    api_keys_file: Path | None = Field(
        default=None, description="see services.keys; read again when it changes"
    )
    allowed_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="names under which the service may be reached, separated by commas; always: this machine's own",
    )
    max_connections: PositiveInt = Field(default=2000, description="of one replica; above it 503")
    labels_dir: Path | None = Field(
        default=None,
        description="holds folders that `dlo label` filled; the label bench opens them",
    )
    max_request_bytes: int = Field(
        default=4 * MEBIBYTE, gt=0, description="the JSON of one request"
    )

    @property
    def has_keys(self) -> bool:
        return bool(self.api_key_hashes or self.api_keys_file)

    @field_validator("api_key_hashes", "allowed_hosts", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        return comma_separated(value)

    @field_validator("api_key_hashes")
    @classmethod
    def _are_hashes(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        if not all(re.fullmatch(r"[0-9a-f]{64}", digest) for digest in value):
            raise ValueError(
                "each must be the SHA-256 of a key, 64 lower-case hex digits; not the key"
            )
        return value

    @model_validator(mode="after")
    def _keys_unless_loopback(self) -> Self:
        if not self.has_keys and not is_loopback(self.host):
            raise ValueError(
                f"refusing to listen on {self.host} without API keys: set DLO_API_KEYS_FILE, or DLO_API_KEY_HASHES "
                "(printf %s KEY | sha256sum), or listen on 127.0.0.1"
            )
        return self


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach ``host``."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
