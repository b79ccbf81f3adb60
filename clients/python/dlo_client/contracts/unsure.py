"""The pictures that the service was least sure of, kept for their owner to correct."""

from __future__ import annotations

from datetime import datetime

from pydantic import Field

from dlo_client.contracts.base import Probability, Reply
from dlo_client.contracts.images import BlobId


class UnsurePicture(Reply):
    """One of them."""

    id: BlobId
    certainty: Probability = Field(
        description="lowest score of its instances and crossings; 0 where nothing was found"
    )
    doubt: str = Field(description="what the certainty comes from, in words")
    bytes: int = Field(ge=0, description="size of the picture, bytes")
    seen_at: datetime = Field(description="when a job looked at it")
