"""Which cable is on top, from the depth beside what the picture shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray
from models.instances.scene import Crossing, Scene
from models.topology.order import depth_map, log_odds
from models.topology.scene import Place

_SURE = 1e-3


@dataclass(frozen=True, eq=False)
class _Strand:
    xy: FloatArray
    width: float


def reordered(scene: Scene, depth_m: Float32Array) -> Scene:
    """The scene with the order of its crossings from the picture and the depth together."""
    strands = [_Strand(item.centerline_xy, item.width_px) for item in scene.instances]
    surface = depth_map(depth_m)

    def of(crossing: Crossing) -> Crossing:
        one, other = crossing.over, crossing.under
        places = Place(one.instance - 1, one.u), Place(other.instance - 1, other.u)
        score = float(np.clip(crossing.score, 0.5, 1 - _SURE))
        odds = float(np.log(score / (1 - score))) + log_odds(*places, strands, surface)
        if odds < 0:
            crossing = replace(crossing, over=other, under=one)
        return replace(crossing, score=1 / (1 + float(np.exp(-abs(odds)))))

    return replace(scene, crossings=tuple(of(crossing) for crossing in scene.crossings))


def covered_stretches(scene: Scene, number: int) -> list[tuple[float, float]]:
    """Where the instance of this id is under another strand, in shares of its length."""
    item = scene.instances[number - 1]
    found = []
    for crossing in scene.crossings:
        if crossing.under.instance == number:
            half = (
                0.75
                * scene.instances[crossing.over.instance - 1].width_px
                / max(item.length_px, 1e-9)
            )
            found.append((crossing.under.u - half, crossing.under.u + half))
    return found
