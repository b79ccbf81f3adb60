"""The picture that a label is of, as it is seen. Needs ``dlo-client[label]``."""

from __future__ import annotations

import io

from PIL import Image, ImageOps

from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.sources import PictureUnreadable, SourcePicture, read_still


def upright(picture: SourcePicture | None, label: PictureLabel) -> Image.Image:
    """Its pixels in RGB, turned as its EXIF data asks. Raises PictureUnreadable: gone, no picture,
    of another size."""
    if picture is None:
        raise PictureUnreadable("the picture is no longer in the source")
    try:
        image = ImageOps.exif_transpose(Image.open(io.BytesIO(read_still(picture)[0]))).convert(
            "RGB"
        )
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise PictureUnreadable(f"cannot be decoded: {error}") from error
    if image.size != (label.width, label.height):
        raise PictureUnreadable(
            f"is {image.width}×{image.height} now, its label {label.width}×{label.height}"
        )
    return image
