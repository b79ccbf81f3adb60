"""A simulated robot with a camera in its hand, over a table with known cables.

It has what ``dlo_client.scan.CameraOnArm`` asks for, without knowing it: plain numbers and bytes.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from models.geometry.arrays import FloatArray
from models.geometry.cameras import Camera, Intrinsics
from models.synthesis.views import Cable3D, Scene3D, noise_texture, random_cable, render

DOWN = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
"""Camera to world: looks down on the table, image y towards -y."""


class SimulatedArm:
    """Moves at once to any pose above the table; ``jitter_m`` and ``jitter_rad`` are how far off
    its encoders are: the pose it reports is not quite the one the picture is taken from."""

    def __init__(
        self,
        scene: Scene3D,
        camera: Camera,
        rng: np.random.Generator,
        *,
        jitter_m: float = 0.0,
        jitter_rad: float = 0.0,
    ) -> None:
        self.scene = scene
        self._camera = camera
        self._rng = rng
        self._jitter = (jitter_m, jitter_rad)
        self.pictures = 0

    @property
    def intrinsics(self) -> dict[str, object]:
        i = self._camera.intrinsics
        sizes = {
            "width": i.width,
            "height": i.height,
            "fx": i.fx,
            "fy": i.fy,
            "cx": i.cx,
            "cy": i.cy,
        }
        return {**sizes, "distortion": list(i.distortion), "distortion_model": i.model}

    def pose(self) -> list[list[float]]:
        """(4, 4) T_world_camera as the encoders have it."""
        return self._camera.T_world_camera.tolist()

    def move_to(self, T_world_camera: Sequence[Sequence[float]]) -> None:
        self._camera = Camera(self._camera.intrinsics, np.array(T_world_camera, np.float64))

    def picture(self) -> bytes:
        """PNG from where the camera really is."""
        self.pictures += 1
        rgb = render(self.scene, self._truly(), self._rng).rgb
        _, data = cv2.imencode(".png", rgb[:, :, ::-1])
        return data.tobytes()

    def _truly(self) -> Camera:
        offset, turn = self._jitter
        pose = self._camera.T_world_camera.copy()
        rotation, _ = cv2.Rodrigues(self._rng.normal(0, 1, 3) * turn)
        pose[:3, :3] = pose[:3, :3] @ rotation
        pose[:3, 3] += self._rng.normal(0, 1, 3) * offset
        return Camera(self._camera.intrinsics, pose)


def camera_above(xy: FloatArray, height_m: float, intrinsics: Intrinsics | None = None) -> Camera:
    """Looks straight down from over ``xy`` (2,); 640 × 480 with f = 600 px unless given."""
    pose = np.eye(4)
    pose[:3, :3] = DOWN
    pose[:3, 3] = (*xy, height_m)
    return Camera(intrinsics or Intrinsics(640, 480, 600.0, 600.0, 319.5, 239.5), pose)


def long_cable(seed: int = 5, length_m: float = 0.8, diameter_m: float = 0.0035) -> SimulatedArm:
    """A blue cable on a speckled table, the camera over its middle: what ``dlo scan`` shows itself
    with."""
    rng = np.random.default_rng(seed)
    points = random_cable(rng, length_m)
    scene = Scene3D((Cable3D(points, diameter_m / 2, (0.1, 0.2, 0.7)),), noise_texture(rng))
    return SimulatedArm(scene, camera_above(points[len(points) // 2, :2], 0.3), rng)
