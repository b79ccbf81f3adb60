"""The kind that adapts a foreground network to one place from a handful of labelled pictures
(thesis section 2.7.2)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from dlo_client.contracts.base import Reply
from dlo_client.contracts.foreground import ModelName
from dlo_client.contracts.images import BlobId
from dlo_client.contracts.networks import NetworkName, UploadRef
from dlo_client.contracts.submission import JobRequest, ModelUsed, Queue

Percent = Annotated[float, Field(ge=0, le=100)]


class LabelsInfo(Reply):
    """A set of labelled pictures that was uploaded."""

    id: BlobId
    bytes: int = Field(gt=0, description="size of the archive, bytes")
    pictures: int = Field(ge=1, description="how many have a label")


class Overlap(Reply):
    """How well a network finds the cables."""

    dice: Percent = Field(
        description="share: 2 |found ∩ true| / (|found| + |true|) in percent, mean over the pictures"
    )


class Retained(Reply):
    """What the network still knows of other places: Dice on renders that no network is adapted
    on."""

    before: Percent = Field(description="Dice of the parent, percent")
    after: Percent = Field(description="Dice of the adapted network, percent")


class AsidePicture(Reply):
    """A labelled picture that was kept aside to measure with."""

    name: str = Field(description="in the archive")
    before: Percent = Field(description="Dice of the parent, percent")
    after: Percent = Field(description="Dice of the adapted network, percent")


class AdaptResult(Reply):
    kind: Literal["adapt"] = Field(default="adapt", description="kind of the job")
    accepted: bool = Field(
        description="a network that is worse, or forgets, is not accepted and not kept"
    )
    refused: str | None = Field(default=None, description="why it was not accepted")
    model: NetworkName | None = Field(
        description="name of the network; null when it was not accepted"
    )
    version: int | None = Field(description="its number under this name")
    in_service: bool = Field(
        description="whether the name stands for it now; else `PUT /v1/models/{name}` lets it"
    )
    before: Overlap = Field(description="of the parent, on the pictures kept aside")
    after: Overlap = Field(description="of the adapted network, on the pictures kept aside")
    general: Retained = Field(description="on other places")
    trained_on: int = Field(description="how many pictures were learnt from")
    kept_aside: list[AsidePicture] = Field(
        description="pictures that were only measured on, the worst first"
    )
    kept_share: float = Field(description="share of the change of the weights that was kept")
    minutes: float = Field(description="minutes of learning")
    warnings: list[str] = Field(default_factory=list, description="what limits the result")
    models: list[ModelUsed] = Field(description="the parent")


class AdaptRequest(JobRequest[AdaptResult]):
    """Labelled pictures of one place to a foreground network that knows it, on workers that train.

    The archive holds `NAME.jpg` or `NAME.png` and `NAME_ids.png` beside it (0 background,
    everything else cable), 5 to 500 pictures; `POST /v1/labels` takes it, `dlo adapt` makes it of
    labels in any format. A part is kept aside, never learnt from, and decides: a network that is
    worse there than its parent, or forgets other places, is refused. The same request again, after
    a cancel or a crash, goes on where it was.
    """

    kind: Literal["adapt"] = Field(default="adapt", description="of the job")
    name: NetworkName = Field(description="of the network to be; a further version if there is one")
    labels: UploadRef = Field(description="as `POST /v1/labels` gave it")
    parent: ModelName | None = Field(
        default=None, description="network to begin from; default: the shipped default"
    )
    minutes: float = Field(
        default=8.0, ge=0.01, le=45, description="minutes of learning, by the clock"
    )
    keep_aside: float = Field(
        default=0.2, ge=0.05, le=0.5, description="share of the pictures that only measures"
    )
    use: bool = Field(default=False, description="let the name stand for it if it is accepted")
    timeout_s: float = Field(
        default=3600.0, gt=0, le=3600, description="from acceptance to the end of the job"
    )

    @property
    def needs_picture(self) -> bool:
        return False

    @property
    def queue(self) -> Queue:
        return "training"
