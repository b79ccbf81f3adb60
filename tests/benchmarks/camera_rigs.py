"""Cameras of a scene turned and moved: rigs with which sections are reconstructed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np

from tests.benchmarks import cable_cell as cell


def _turned(cameras: list, rotations: list[tuple[float, float, float]]) -> list:
    out = []
    for camera, rotation in zip(cameras, rotations, strict=True):
        pose = camera.T_world_camera.copy()
        pose[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.array(rotation, np.float64))[0]
        out.append(replace(camera, T_world_camera=pose))
    return out


def _along(cameras: list) -> list:
    """The slide along the cable's main direction, y, instead of across."""
    middle = cameras[1].T_world_camera
    out = []
    for step in (-cell.BASELINE_M, 0.0, cell.BASELINE_M):
        pose = middle.copy()
        pose[1, 3] += step
        out.append(replace(cameras[1], T_world_camera=pose))
    return out


RIGS: dict[str, Callable[[list], list]] = {
    "normal": lambda c: c,
    "converging by 6°": lambda c: _turned(c, [(0, 0.1, 0), (0, 0, 0), (0, -0.1, 0)]),
    "rolled by 30°": lambda c: _turned(c, [(0, 0, 0.5), (0, 0, 0), (0, 0, -0.5)]),
    "along the baseline": _along,
}
