"""Along a cable with a camera on an arm; here the arm and its pictures are drawn.

Replace ``DrawnArm`` by a class with the same four members for a real robot.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from typing import Any

from dlo_client import Client, Scan, ScanOptions, ScanResult
from PIL import Image, ImageDraw

Pose = Sequence[Sequence[float]]


class DrawnArm:
    """A blue cable on a speckled table, seen from above."""

    intrinsics = {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 319.5, "cy": 239.5}  # noqa: RUF012

    def __init__(self, half_length_m: float = 0.2) -> None:
        steps = [half_length_m * (k / 60 - 1) for k in range(121)]
        self._cable = [(x, 0.02 * math.sin(9 * x), 0.004) for x in steps]
        self._pose: Pose = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.25], [0, 0, 0, 1]]

    def pose(self) -> Pose:
        return self._pose

    def move_to(self, T_world_camera: Pose) -> None:
        self._pose = T_world_camera

    def picture(self) -> Image.Image:
        noise = Image.effect_noise((640, 480), 24).convert("RGB")
        picture = Image.blend(noise, Image.new("RGB", (640, 480), (190, 180, 165)), 0.75)
        line = [self._seen(point) for point in self._cable]
        draw = ImageDraw.Draw(picture)
        draw.line(line, fill=(25, 60, 170), width=16, joint="curve")
        draw.line(line, fill=(60, 100, 210), width=6, joint="curve")
        return picture

    def _seen(self, point: tuple[float, float, float]) -> tuple[float, float]:
        away = [p - row[3] for p, row in zip(point, self._pose, strict=False)]
        x, y, z = (sum(self._pose[i][axis] * away[i] for i in range(3)) for axis in range(3))
        return 319.5 + 600 * x / z, 239.5 + 600 * y / z


def main(arguments: list[str] | None = None) -> ScanResult:
    """The whole curve."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--sections", type=int, default=2, help="at most, in each direction")
    options = parser.parse_args(arguments)
    settings: dict[str, Any] = {"optimise": "fixed", "at_most": options.sections}
    with Client(options.url) as client:
        result = Scan(client, DrawnArm(), ScanOptions(**settings)).run()
    print(f"{result.curve.length_m:.3f} m from {len(result.sections)} sections")
    for end, why in zip(("ahead", "behind"), result.ended, strict=False):
        print(f"  {end}: {why}")
    return result


if __name__ == "__main__":
    main()
