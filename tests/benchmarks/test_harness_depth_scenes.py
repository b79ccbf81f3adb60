"""Harnesses in color and depth: heights, shadows and depths fit together."""

from __future__ import annotations

import numpy as np
import pytest

from models.synthesis.depth_sensor import SensorParams
from models.synthesis.harness import HarnessParams
from tests.benchmarks.harness_depth_scenes import HarnessScene, harness_scene

PARAMS = HarnessParams(
    size=(160, 240), branch_points=(1, 2), harnesses=(1, 1), cables=(0, 0), crossings=(1, 3)
)


@pytest.fixture(scope="module")
def scene() -> HarnessScene:
    sensor = SensorParams(sigma_m=1e-6, holes=0.0, flying=0.0, shadow=0.0, step_m=1e-6)
    return next(
        s
        for k in range(20)
        if (s := harness_scene(np.random.default_rng(k), PARAMS, sensor)).harness.crossings
    )


def test_cables_are_nearer_than_the_table_and_crossings_nearer_still(scene: HarnessScene) -> None:
    table = np.median(scene.depth_m[~scene.mask])
    assert np.isfinite(scene.depth_m).all()
    for section in scene.harness.sections:
        column, row = np.rint(section.xy[len(section.xy) // 2]).astype(int)
        assert table - scene.depth_m[row, column] > 0.5 * section.width * 0.001
    for crossing in scene.harness.crossings:
        column, row = np.rint(crossing.xy).astype(int)
        widths = [scene.harness.sections[k].width for k in (crossing.a, crossing.b)]
        assert table - scene.depth_m[row, column] > 0.7 * sum(widths) * 0.001


def test_shadows_are_dark_flat_and_beside_the_cables(scene: HarnessScene) -> None:
    assert scene.shadow.any()
    assert not (scene.shadow & scene.mask).any()
    lit = ~scene.shadow & ~scene.mask
    assert scene.rgb[scene.shadow].mean() < 0.8 * scene.rgb[lit].mean()
    assert abs(np.median(scene.depth_m[scene.shadow]) - np.median(scene.depth_m[lit])) < 0.02
