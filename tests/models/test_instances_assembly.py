"""Chains of points to instances."""

from __future__ import annotations

import numpy as np

from models.instances.assembly import assemble
from models.strands.chain import Chain
from models.strands.stopwatch import Stopwatch


def test_a_chain_that_turns_back_at_about_one_place_is_fitted() -> None:
    """Two neighbors a rounding error apart gave a spline of NaN, and the job was `internal`
    (Ariadne+ on a mask full of clutter)."""
    mask = np.zeros((360, 640), bool)
    mask[240:250, :12] = True
    x, y = 5.9534264779704325, 243.31235813988388
    there = np.array([[0.0, 246.0], [x, y], [np.nextafter(x, 0), y], [8.9e-16, 246.0]])
    distances = np.full(mask.shape, 1.0, np.float32)
    scene = assemble(
        [Chain(there, False)], mask, distances, None, Stopwatch(), method="ariadne_plus"
    )
    assert all(np.isfinite(i.centerline_xy).all() for i in scene.instances)
