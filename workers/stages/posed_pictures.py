"""A picture from a known pose, as the requests with ``views`` bring it."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts.cameras import CameraView
from numpy.typing import NDArray

from models.geometry.cameras import Camera
from workers.stages import curves3d
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.pictures import read_rgb


def read_view(given: CameraView, field: str, tools: Tools) -> tuple[NDArray[np.uint8], Camera]:
    """Raises InvalidInput, below ``field``, for a picture that is missing, cannot be read, or is not of its camera's
    size."""
    if given.image is None:
        raise InvalidInput(f"{field}.image", "is missing")
    camera = curves3d.camera(given, field)
    image = read_rgb(given.image, f"{field}.image", tools)
    size = (camera.intrinsics.width, camera.intrinsics.height)
    if image.shape[1::-1] != size:
        found = f"{image.shape[1]} × {image.shape[0]}"
        message = f"are of a picture of {size[0]} × {size[1]} pixels, but this one has {found}"
        raise InvalidInput(f"{field}.intrinsics", message, "invalid_camera")
    return image, camera
