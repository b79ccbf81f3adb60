"""The one TOML file of a bridge::

    [service]
    url = "http://127.0.0.1:8000"       # the API key is DLO_API_KEY of the environment

    [ascii]
    port = 4711
    reply = "plain"                     # or "parentheses", as URScript reads numbers

    [binary]
    port = 4712
    byte_order = "big"

    [opcua]                             # needs the extra dlo-client[opcua]
    port = 4840

    [picture]
    folder = "/data/camera"             # the newest file that matches; or file = "…", or url = "http://camera/…"
    pattern = "*.png"

    [jobs]
    most_waiting = 8
    result_wait_s = 10.0
    timeout_s = 30.0

What is not listed here is refused.
"""

from __future__ import annotations

import ipaddress
import tomllib
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, IPvAnyAddress, ValidationError, model_validator

from dlo_client.errors import InvalidArgument, describe_fields

_Seconds = Annotated[float, Field(gt=0, le=3600)]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ServiceSection(_Section):
    """Which service runs the recipes."""

    url: str | None = Field(default=None, description="its address; default DLO_URL")


class ListenSection(_Section):
    """Where one protocol is offered. Only the peers of ``allow`` are answered on another address
    than loopback."""

    port: int = Field(ge=0, le=65_535, description="TCP; 0 takes a free one")
    host: str = Field(default="127.0.0.1", description="address of this machine to listen on")
    allow: tuple[IPvAnyAddress, ...] = Field(
        default=(), description="addresses of controllers; empty: loopback only"
    )

    @model_validator(mode="after")
    def _guarded(self) -> ListenSection:
        if not ipaddress.ip_address(self.host).is_loopback and not self.allow:
            raise ValueError("`allow` must list the controllers: the bridge asks for no key")
        return self


class AsciiSection(ListenSection):
    """Text lines."""

    reply: Literal["plain", "parentheses"] = Field(
        default="plain", description="form of the replies"
    )


class BinarySection(ListenSection):
    """Fixed bytes."""

    byte_order: Literal["big", "little"] = Field(default="big", description="of all numbers")


class OpcUaSection(_Section):
    """OPC UA, opc.tcp. Other addresses than loopback need a certificate and its key: calls are then
    encrypted."""

    port: int = Field(default=4840, ge=1, le=65_535, description="TCP")
    host: str = Field(default="127.0.0.1", description="address of this machine to listen on")
    certificate: Path | None = Field(default=None, description="of the server, DER or PEM")
    key: Path | None = Field(default=None, description="of the certificate, PEM")

    @model_validator(mode="after")
    def _guarded(self) -> OpcUaSection:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("`certificate` and key belong together")
        if not ipaddress.ip_address(self.host).is_loopback and self.certificate is None:
            raise ValueError("`certificate` and key are needed on another address than loopback")
        return self


class PictureSection(_Section):
    """Where the picture of a trigger comes from."""

    folder: Path | None = Field(default=None, description="its newest file that matches `pattern`")
    pattern: str = Field(default="*", description="of file names in `folder`")
    most_age_s: float | None = Field(
        default=None, gt=0, description="an older file is no picture of this trigger"
    )
    file: Path | None = Field(default=None, description="one file, read anew at every trigger")
    url: str | None = Field(
        default=None, pattern=r"^https?://", description="snapshot address of a camera"
    )

    @model_validator(mode="after")
    def _one_source(self) -> PictureSection:
        if sum(source is not None for source in (self.folder, self.file, self.url)) != 1:
            raise ValueError("`folder`, `file`, `url`: give exactly one")
        return self


class JobsSection(_Section):
    """Bounds."""

    most_waiting: int = Field(
        default=8, ge=1, le=256, description="jobs under way, above which none is accepted"
    )
    result_wait_s: float = Field(
        default=10.0, ge=0, le=60, description="how long a request for a result is held"
    )
    timeout_s: _Seconds = Field(default=30.0, description="for the whole job")


class BridgeSettings(_Section):
    """All settings of a bridge."""

    service: ServiceSection = ServiceSection()
    ascii: AsciiSection | None = None
    binary: BinarySection | None = None
    opcua: OpcUaSection | None = None
    picture: PictureSection
    jobs: JobsSection = JobsSection()

    @model_validator(mode="after")
    def _something_to_do(self) -> BridgeSettings:
        if self.ascii is None and self.binary is None and self.opcua is None:
            raise ValueError("`ascii`, binary, opcua: at least one section is needed")
        return self


def read(path: Path) -> BridgeSettings:
    """Raises InvalidArgument naming the field, or OSError."""
    try:
        return BridgeSettings.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except ValidationError as error:
        raise InvalidArgument(str(path), describe_fields(error)) from None
    except ValueError as error:
        raise InvalidArgument(str(path), f"is no TOML: {error}") from None
