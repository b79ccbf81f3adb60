"""How ropes of a simulator move through a clip: dragged and turned by a hand on a table, one edge
after the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.synthesis.clips import ClipParams
from models.synthesis.curves import FloatArray, interpolate
from tests.benchmarks.ropes import ROPES, FilmedTable

_STEPS = 3
"""Of the gripper, 10 ms each, between two frames: 3 mm of its way, a third to two thirds of a
rope's width."""
_NODES = 24
"""Of a rope: more than the planner's, so that it bends as smoothly as a cable in a picture."""
_DRAG_M, _TURN_RAD = 0.05, 0.5
"""Standard deviations of what a hand does to an edge."""
_HOMEWARD = 0.3
"""Part of its way to the middle of the table by which a rope is dragged beside that: it stays in
the picture."""
_SPACING_PX = 0.7


class RopeCourse:
    """A rope in MuJoCo, in a picture in which a cable's width is the rope's diameter. Each rope is
    alone on its table: ropes that cross in the picture do not touch."""

    def __init__(self, rng: np.random.Generator, params: ClipParams) -> None:
        kind = ROPES[int(rng.integers(len(ROPES)))]
        scale, size = params.width_px / kind.diameter, np.array(params.size[::-1])
        length = rng.uniform(0.5, 0.8) * size[0] / scale
        table = FilmedTable(replace(kind, length=length), "cloth", _NODES)
        table.put(_shape(rng, length) + rng.uniform(-0.15, 0.15, 2) * size / scale)
        table.frames.clear()
        while len(table.frames) < _STEPS * params.frames:
            shift = rng.normal(0, _DRAG_M, 2) - _HOMEWARD * table.state().mean(0)
            table.act(int(rng.integers(_NODES - 1)), np.append(shift, rng.normal(0, _TURN_RAD)))
        height = np.cumsum(rng.normal(0, 0.1, _NODES)) + rng.uniform(0, 1)
        self._shapes = [
            np.column_stack([size / 2 + scale * xy, height]) for xy in table.frames[::_STEPS]
        ]

    def at(self, t: int) -> FloatArray:
        """(m, 3) dense centerline at frame ``t``."""
        return interpolate(self._shapes[t].astype(np.float32), _SPACING_PX)


def _shape(rng: np.random.Generator, length: float) -> np.ndarray:
    """(n, 2) m, about its middle, of random direction and bends."""
    u = np.linspace(-0.5, 0.5, _NODES - 1)
    bends = sum(
        rng.normal(0, 0.4 / k) * np.cos(2 * np.pi * k * u + rng.uniform(0, 6))
        for k in (0.5, 1.0, 1.5)
    )
    heading = rng.uniform(-np.pi, np.pi) + np.asarray(bends)
    steps = length / (_NODES - 1) * np.column_stack([np.cos(heading), np.sin(heading)])
    points = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return np.asarray(points - points.mean(0))
