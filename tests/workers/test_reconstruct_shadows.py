"""A thin cable beside its own soft shadow, through the shipped networks."""

from __future__ import annotations

import numpy as np
import pytest

from models.reconstruction.curves import distances
from models.reconstruction.reconstruct import ReconstructParams, reconstruct_all
from models.synthesis.views import Cable3D, Optics, Scene3D, noise_texture, random_cable
from tests.benchmarks import cable_cell as cell
from workers.stages.outcome import Tools

pytestmark = pytest.mark.slow

HEIGHT_M = 0.0012
LIGHT = (-1.2, 0.0, 0.7)
"""Along the slide of the camera: the shadow is beside the cable where depth comes from."""


@pytest.fixture(scope="module")
def tools() -> Tools:
    return cell.tools()


def error_mm(color: int, seed: int, shadow: float, tools: Tools) -> float:
    """Mean distance of the curve of a cable of 2 mm to the truth, from three views 25 mm apart at
    0.28 m."""
    points = random_cable(np.random.default_rng(seed), 0.16, bend=2.0, rise_m=0.0)
    points[:, 2] = HEIGHT_M
    cable = Cable3D(points, 0.001, cell.COLORS[color])
    ground = noise_texture(np.random.default_rng(seed + 50))
    scene = Scene3D((cable,), ground, Optics(light=LIGHT, shadow=shadow))
    views = cell.seen(scene, cell.row(scene, 3, 0.025, 0.28 + HEIGHT_M), tools, seed)
    curve = reconstruct_all(views, ReconstructParams())[0].curve
    return 1000 * float(distances(curve.points_m, cell.dense(points)).mean())


@pytest.mark.parametrize(("color", "seed"), [(0, 0), (4, 2)], ids=["blue", "black"])
def test_a_soft_shadow_beside_a_thin_cable_moves_no_depth(
    color: int, seed: int, tools: Tools
) -> None:
    """The curve was 3 mm off in depth: the shadow moved an edge in one view and not in the
    other."""
    without, beside = (error_mm(color, seed, shadow, tools) for shadow in (0.0, 0.6))
    assert beside < 1.0
    assert beside < without + 0.3
