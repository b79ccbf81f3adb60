"""How thick a cable is, by how wide it is seen."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.cameras import Camera, Intrinsics
from models.reconstruction.views import Strand, View
from models.reconstruction.widths import radius_along

RADIUS_M = 0.00175
INTRINSICS = Intrinsics(1200, 900, 600.0, 600.0, 599.5, 449.5)


def seen(middle: np.ndarray) -> View:
    """A straight cable about ``middle`` (3,) m before a camera that looks along z, as wide as its
    surface is seen."""
    along = np.linspace(-0.03, 0.03, 61)
    line = middle + along[:, None] * np.array([0.0, 1.0, 0.0])
    around = np.linspace(0, 2 * np.pi, 720)
    camera = Camera(INTRINSICS, np.eye(4))
    surface = line[:, None] + RADIUS_M * np.stack([np.cos(around), 0 * around, np.sin(around)], 1)
    across = camera.project(surface.reshape(-1, 3))[:, 0].reshape(len(line), -1)
    return View(camera, (Strand.through(camera.project(line), np.ptp(across, axis=1)),), "view")


@pytest.mark.parametrize("x", [0.0, 0.05, 0.1])
def test_a_cable_off_the_axis_of_the_camera_is_no_thicker(x: float) -> None:
    """Cameras that stand apart see a cable at a slant: wider than ``2 r f / z``, by a fifth at 34
    degrees."""
    view = seen(np.array([x, 0.0, 0.15]))
    points = np.array([x, 0.0, 0.15]) + np.linspace(-0.02, 0.02, 21)[:, None] * np.array(
        [0.0, 1.0, 0.0]
    )
    radius, _ = radius_along(points, [view], [np.array([0])])
    assert radius == pytest.approx(np.full(21, RADIUS_M), rel=0.005)
