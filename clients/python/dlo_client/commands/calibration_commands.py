"""``dlo calibrate``: where the camera is on the robot, from pictures of a board."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from dlo_client.client import Client
from dlo_client.commands.app import app
from dlo_client.commands.printing import print_lines
from dlo_client.contracts.cameras import PinholeIntrinsics
from dlo_client.contracts.frames import RotationConvention, Unit
from dlo_client.contracts.recipes import CameraBody
from dlo_client.errors import InvalidArgument

if TYPE_CHECKING:
    from dlo_client.calibration.hand_eye import HandEye

_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
_EXTRA = 'needs its extra: pip install "dlo-client[calibrate]"'


@app.command()
def calibrate(
    context: typer.Context,
    pictures: Annotated[
        Path, typer.Argument(metavar="FOLDER", file_okay=False, help="Pictures of the board.")
    ],
    flange: Annotated[
        Path, typer.Option(dir_okay=False, help="CSV: picture, x, y, z, rotation of the flange.")
    ],
    intrinsics: Annotated[Path, typer.Option(dir_okay=False, help="JSON of PinholeIntrinsics.")],
    board: Annotated[
        str, typer.Option(help="columns x rows x square in m [x marker in m], as 7x5x0.03x0.022.")
    ],
    store: Annotated[
        str | None, typer.Option(help="Store the camera in the service under this name.")
    ] = None,
    mount: Annotated[
        Literal["flange", "stand"],
        typer.Option(help="Where the camera is; on a stand the flange holds the board."),
    ] = "flange",
    unit: Annotated[Unit, typer.Option(help="Of the flange's positions.")] = "mm",
    rotation: Annotated[
        RotationConvention, typer.Option(help="Of the flange's rotations.")
    ] = "quaternion_xyzw",
    dictionary: Annotated[
        str, typer.Option(help="Of a charuco board: 4x4, 5x5, 6x6, apriltag.")
    ] = "5x5",
) -> None:
    """Find where the camera is on the robot: from 10 or more pictures of a chessboard or ChArUco
    board, the flange turned about different axes; with its uncertainty."""
    try:
        from dlo_client.calibration import board_pictures
    except ModuleNotFoundError as error:
        raise InvalidArgument("dlo calibrate", f"{_EXTRA} (not found: {error.name})") from None
    lens = PinholeIntrinsics.model_validate_json(intrinsics.read_text())
    files = sorted(path for path in pictures.iterdir() if path.suffix.lower() in _SUFFIXES)
    found, used, unseen = board_pictures.hand_eye(
        files, flange, (unit, rotation), (board, dictionary), lens, mount
    )
    name = "T_flange_camera" if mount == "flange" else "T_world_camera"
    pose = [[round(float(value), 9) for value in row] for row in found.T]
    left_out = f", without {len(unseen)}: {', '.join(unseen)}" if unseen else ""
    print_lines([json.dumps({name: pose}), f"from {used} pictures{left_out}", *_accuracy(found)])
    fields: dict[str, Any] = {"intrinsics": lens, name: pose}
    camera = CameraBody.model_validate(
        fields | {"sigma_m": found.sigma_m, "sigma_rad": found.sigma_rad}
    )
    if store is not None:
        client: Client = context.obj
        print_lines([f"stored as {store}, version {client.store_camera(store, camera).version}"])


def _accuracy(found: HandEye) -> list[str]:
    return [
        f"standard deviation {found.sigma_m * 1000:.3f} mm, "
        f"{found.sigma_rad * 57.29578:.4f} degrees; "
        f"residual {found.residual_px:.3f} px, worst picture {max(found.residuals_px):.3f} px"
    ]
