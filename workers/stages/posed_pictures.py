"""A picture from a known pose, as the requests with ``views`` bring it."""

from __future__ import annotations

from dlo_client.contracts.cameras import CameraView

from models.geometry.cameras import Camera
from workers.stages import curves3d
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.pictures import Picture, read_picture


def read_view(
    given: CameraView, field: str, tools: Tools, *, may_be_mask: bool = False
) -> tuple[Picture, Camera]:
    """Raises InvalidInput, below ``field``, for a picture that is missing, cannot be read, or is
    not of its camera's size."""
    if given.image is None:
        raise InvalidInput(f"{field}.image", "is missing")
    camera = curves3d.camera(given, field)
    picture = read_picture(given.image, f"{field}.image", tools, may_be_mask=may_be_mask)
    size = (camera.intrinsics.width, camera.intrinsics.height)
    height, width = picture.rgb.shape[:2]
    if (width, height) != size:
        found = f"{width} × {height}"
        message = f"are of a picture of {size[0]} × {size[1]} pixels, but this one has {found}"
        raise InvalidInput(f"{field}.intrinsics", message, "invalid_camera")
    return picture, camera
