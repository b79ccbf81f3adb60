"""A cell with known cables for the reconstruction benchmark: rendered views, what the shipped
networks see in them, and the stages in this process in place of a service."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from dlo_client.contracts import AnyJob, ImageRef, Problem
from dlo_client.contracts.foreground import ForegroundOptions
from dlo_client.errors import JobFailed

from models.geometry.cameras import Camera
from models.reconstruction.joining import rejoin
from models.reconstruction.seeing import strands_of
from models.reconstruction.views import Strand, View
from models.synthesis.arm import camera_above
from models.synthesis.views import Cable3D, Scene3D, noise_texture, random_cable, render
from workers import stages
from workers.settings import Settings
from workers.stages.foreground import Source
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.perception import perceive

COLORS = ((0.1, 0.2, 0.7), (0.8, 0.1, 0.1), (0.1, 0.5, 0.2), (0.9, 0.7, 0.1), (0.05, 0.05, 0.05))
DISTANCE_M = 0.25
BASELINE_M = 0.025
"""The fixed setup of thesis section 4.6.1, from one view to the next."""


def tools() -> Tools:
    return stages.warm(Settings(data_dir=Path(tempfile.mkdtemp()), onnx_threads=1))


class InProcess:
    """What Scan needs of a Client, without HTTP."""

    def __init__(self, held: Tools) -> None:
        self._tools = held

    def run(self, request: Any, image: Sequence[bytes] | None = None) -> Any:
        if image is not None:
            refs = [ImageRef(id=self._tools.blobs.put(data)) for data in image]
            views = [
                v.model_copy(update={"image": ref})
                for v, ref in zip(request.views, refs, strict=True)
            ]
            request = request.model_copy(update={"views": views, "files": []})
        try:
            return stages.run(request, self._tools).result
        except InvalidInput as error:
            problem = Problem(title="", status=422, detail=str(error), code=error.code)
            common = {
                "id": "0" * 32,
                "kind": request.kind,
                "priority": "interactive",
                "created_at": datetime.now(UTC),
            }
            raise JobFailed(
                AnyJob(**common, state="failed", progress=1, problem=problem), problem
            ) from error


def cable_scene(
    seed: int, diameter_m: float = 0.0035, texture: np.ndarray | None = None
) -> Scene3D:
    """One random cable of 0.8 m over a speckled table, or over ``texture``."""
    rng = np.random.default_rng(seed)
    points = random_cable(rng, 0.8)
    ground = noise_texture(rng)
    cable = Cable3D(points, diameter_m / 2, COLORS[seed % len(COLORS)])
    return Scene3D((cable,), ground if texture is None else texture)


def row(
    scene: Scene3D, views: int = 3, baseline_m: float = BASELINE_M, z: float = DISTANCE_M
) -> list[Camera]:
    """Cameras over the middle of the first cable; ``baseline_m`` from one to the next."""
    points = scene.cables[0].points_m
    middle = points[len(points) // 2, :2]
    slide = (np.arange(views) - (views - 1) / 2) * baseline_m
    return [camera_above(middle + np.array([x, 0.0]), z) for x in slide]


def seen(scene: Scene3D, cameras: Sequence[Camera], held: Tools, seed: int = 0) -> list[View]:
    """The centerlines that the shipped networks find in the rendered views, joined as the service
    does it."""
    rng = np.random.default_rng([seed, 1])
    views = []
    for number, camera in enumerate(cameras):
        rgb = render(scene, camera, rng).rgb
        found = perceive(Source(rgb, None, []), held, ForegroundOptions())
        strands, _ = strands_of(found.scene, found.foreground.probability, rgb, camera)
        views.append(View(camera, strands, f"view {number}"))
    return [joined.view for joined in rejoin(views)]


def exact(
    curves: Sequence[np.ndarray],
    cameras: Sequence[Camera],
    noise_px: float,
    rng: np.random.Generator,
) -> list[View]:
    """The true centerlines with a point about every 5 px, each moved by its own noise."""
    views = []
    for number, camera in enumerate(cameras):
        strands = []
        for curve in curves:
            xy = camera.project(curve)
            xy = xy[camera.sees(xy)]
            length = np.hypot(*np.diff(xy, axis=0).T).sum()
            thin = xy[:: max(1, int(len(xy) * 5 / length))]
            strands.append(Strand.through(thin + rng.normal(0, noise_px, thin.shape), 8.0))
        views.append(View(camera, tuple(strands), f"view {number}"))
    return views


def dense(points: np.ndarray, count: int = 20_000) -> np.ndarray:
    old, new = np.linspace(0, 1, len(points)), np.linspace(0, 1, count)
    return np.stack([np.interp(new, old, axis) for axis in points.T], axis=1)


def textures(shared: Path) -> dict[str, np.ndarray]:
    """A few CC0 materials as tables, by name; none without the folder."""
    files = sorted((shared / "textures" / "ambientcg128").glob("*"))[::97][:2]
    found = {}
    for file in files:
        tile = cv2.imread(str(file))
        if tile is not None:
            found[file.stem] = np.tile(cv2.resize(tile, (192, 192)), (8, 8, 1))[:, :, ::-1]
    return found
