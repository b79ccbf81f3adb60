"""Chains of points to instances."""

from __future__ import annotations

import numpy as np

from models.instances.assembly import assemble
from models.strands.chain import Chain
from models.strands.foreground import Foreground
from models.strands.stopwatch import Stopwatch


def test_a_chain_that_turns_back_at_about_one_place_is_fitted() -> None:
    """Two neighbors a rounding error apart gave a spline of NaN, and the job was `internal` (Ariadne+ on a mask full of
    clutter)."""
    mask = np.zeros((60, 80), bool)
    mask[25:32, 5:70] = True
    there = np.array([[10.0, 28.0], [60.0, 28.0], [60.0, 28.0 + 9e-16], [10.0, 28.0]])
    there[2, 0] += 9e-15
    assert 0 < np.hypot(*(there[2] - there[1])) < 1e-12
    scene = assemble(
        [Chain(there, False)], mask, Foreground.of(mask).distances, None, Stopwatch(), method="ariadne_plus"
    )
    assert len(scene.instances) == 1
    assert np.isfinite(scene.instances[0].centerline_xy).all()
