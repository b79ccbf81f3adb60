"""Networks as data: what is known of one, the file that it travels in, and the job that takes one
in."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field

from dlo_client.contracts.base import Contract, Probability, Reply, Taken
from dlo_client.contracts.images import BlobId
from dlo_client.contracts.submission import JobRequest

NetworkName = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_.-]{0,63}$")]


class UploadRef(Taken):
    """Bytes that are no picture, uploaded before: a network or a set of labels."""

    id: BlobId


class NetworkVersion(Reply):
    """One version of a network that was trained or brought here."""

    version: int = Field(ge=1, description="counted from 1 on, never given twice")
    sha256: BlobId = Field(description="of its ONNX file")
    created_at: datetime = Field(description="when it was stored")
    parent: str | None = Field(
        default=None, description="the network that it was trained from, as `name@version`"
    )
    origin: str = Field(description="how it was made")
    metrics: dict[str, float] = Field(
        default_factory=dict, description="measured by the one who trained it, by name"
    )


class NetworkInfo(Reply):
    """A network that a request may name, or that the service uses by itself, as ``GET /v1/models``
    shows it."""

    name: str = Field(description="what a request's `model` names; `name@2` is its second version")
    version: str = Field(description="of the network: the one that its name stands for")
    task: str = Field(description="what it is for: `foreground`, `links`, …")
    default: bool = Field(description="taken for its task when a request names none")
    warm: bool = Field(
        default=True,
        description="loaded before a worker takes jobs; others are loaded by the first job that names them",
    )
    sha256: str = Field(description="of its file")
    bytes: int = Field(description="size of its file, bytes")
    parameters: int = Field(description="how many numbers were trained")
    input: str = Field(description="layout, size and normalization in words")
    origin: str = Field(description="how it was made")
    license: str = Field(description="of its weights")
    metrics: dict[str, float] = Field(
        default_factory=dict, description="measured by the one who trained it, by name"
    )
    shipped: bool = Field(
        default=True, description="part of this release; others were adapted or brought here"
    )
    owner: str = Field(
        default="", description="name of the API key that stored it; it and admins may change it"
    )
    parent: str | None = Field(default=None, description="the network that it was trained from")
    versions: list[NetworkVersion] = Field(
        default_factory=list,
        description="all that are kept, oldest first; none of a shipped network",
    )


class Preprocess(Contract):
    """How a foreground network is fed, and how its answer becomes a mask."""

    long_side: int = Field(ge=32, le=4096, description="pixels; larger pictures are reduced to it")
    most_enlarged: float = Field(
        default=1.0, ge=1, le=4, description="times that a smaller picture is enlarged to it"
    )
    multiple: int = Field(ge=1, le=256, description="sides are filled up to multiples of it")
    mean: tuple[float, float, float] = Field(description="of (x / 255 - mean) / std")
    std: tuple[float, float, float] = Field(description="of (x / 255 - mean) / std")
    threshold: Probability = Field(description="from which a pixel is foreground")
    certainty: Probability = Field(description="mean probability that a connected patch needs")
    least_area: float = Field(ge=0, le=1e6, description="pixels that a connected patch needs")


class NetworkCard(Reply):
    """``card.json`` in the file of a network: all but its weights."""

    format: Literal["dlo-network/1"] = Field(default="dlo-network/1", description="of the file")
    name: NetworkName = Field(description="under which it was made")
    task: Literal["foreground"] = Field(default="foreground", description="what it is for")
    architecture: Annotated[str, Field(pattern=r"^[a-z0-9_]{1,40}$")] = Field(
        description="its kind, by the name under which it can be trained further; `unknown` if it cannot"
    )
    parent: str | None = Field(
        default=None, max_length=80, description="trained from, as `name@version`"
    )
    sha256: BlobId = Field(description="of `network.onnx`")
    parameters: int = Field(ge=1, le=1_000_000_000, description="how many numbers were trained")
    origin: str = Field(max_length=500, description="how it was made")
    license: str = Field(default="unknown", max_length=100, description="of its weights")
    preprocess: Preprocess = Field(description="how it is fed")
    metrics: dict[str, float] = Field(
        default_factory=dict, max_length=50, description="measured, by name"
    )
    created_at: datetime = Field(description="when it was made")


class ImportNetworkResult(Reply):
    kind: Literal["import_network"] = Field(default="import_network", description="kind of the job")
    network: NetworkInfo = Field(description="the network as it is stored now")


class ImportNetworkRequest(JobRequest[ImportNetworkResult]):
    """Take in a network from its file: it is checked by a worker, then stored as a new version of
    its name.

    ``POST /v1/models`` makes this job. The first version of a name is what the name stands for; a
    further one is not, until ``PUT /v1/models/{name}`` asks for it.
    """

    kind: Literal["import_network"] = Field(default="import_network", description="of the job")
    file: UploadRef = Field(description="of the uploaded file")
    name: NetworkName | None = Field(default=None, description="default: the name in the file")

    @property
    def needs_picture(self) -> bool:
        return False


class VersionChoice(Contract):
    """Body of ``PUT /v1/models/{name}``."""

    version: int = Field(ge=1, description="version that the name stands for from now on")
