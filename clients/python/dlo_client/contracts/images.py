"""How a picture is named in a request. Pixel convention: see
:data:`dlo_client.contracts.base.Point`.

A picture whose EXIF data asks for a rotation is turned upright before anything else happens to it:
sizes and coordinates in every answer are those of the upright picture.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from dlo_client.contracts.base import Contract, Reply, Taken

BlobId = Annotated[
    str, Field(pattern=r"^[0-9a-f]{64}$", description="SHA-256 of the bytes, lower-case hex")
]


class ImageRef(Taken):
    """A picture uploaded before with ``POST /v1/images``; what that answered fits."""

    id: BlobId


class ImagePart(Contract):
    """The n-th ``image`` part of the multipart request that carries this field, counted from 0."""

    part: int = Field(ge=0, lt=64, description="number of the `image` part, from 0")


ImageSource = ImageRef | ImagePart


PictureWarnings = Annotated[
    list[str],
    Field(
        description="how a picture was read where that may surprise its sender: taken as a mask, further pages passed "
        "over, values scaled, nothing but one color; each begins with the field"
    ),
]


class ImageInfo(Reply):
    """What the service knows of an uploaded picture; ``width`` and ``height`` of the upright
    picture."""

    id: BlobId
    sha256: BlobId
    width: int = Field(gt=0, description="of the upright picture, pixels")
    height: int = Field(gt=0, description="of the upright picture, pixels")
    bytes: int = Field(gt=0, description="size of the encoded picture, bytes")
