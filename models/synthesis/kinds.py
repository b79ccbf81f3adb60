"""One picture of every kind of scene and of clutter that the renderer knows: the plates of the
documentation."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import torch

from models.geometry.arrays import ByteArray
from models.synthesis import boards, lookalikes, panels, surfaces, tools
from models.synthesis.canvas import Canvas
from models.synthesis.scenes import Labelled, SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool

Painter = Callable[[Canvas, np.random.Generator], None]
_SIZE = (216, 384)
_TRIED = 8
_BASE = SceneParams(_SIZE, (0.012, 0.05), max_cables=4, empty_share=0.0, clutter=0.0)

SCENES: Mapping[str, SceneParams] = {
    "on_a_table": replace(_BASE, clutter=1.0),
    "in_the_air": replace(_BASE, air_share=1.0),
    "fan": replace(_BASE, fan_share=1.0, width_share=(0.02, 0.05)),
    "ribbon": replace(_BASE, ribbon_share=1.0, width_share=(0.015, 0.03)),
    "thin_wires": replace(_BASE, width_share=(0.005, 0.008), max_cables=6),
    "thick": replace(_BASE, width_share=(0.09, 0.16), max_cables=2, style="busy", clutter=1.0),
    "like_the_ground": replace(_BASE, alike_share=1.0),
    "among_machines": replace(_BASE, clutter=1.0, style="industrial"),
    "workshop": replace(_BASE, clutter=1.0, style="workshop"),
}
"""Scenes with cables, by name."""

LOOKALIKES: Mapping[str, Painter] = {
    "tile_joints": surfaces.tiles,
    "seams": surfaces.seams,
    "handle": lookalikes.handle,
    "rods": tools.rods,
    "spring": lookalikes.spring,
    "drawn_arrow": lookalikes.arrow,
    "table_edge": lookalikes.table_edge,
    "ruled_mat": lookalikes.ruled_mat,
    "fan_grille": lookalikes.grille,
    "printed_traces": boards.board,
    "drag_chain": lookalikes.drag_chain,
    "stray_shadow": lookalikes.stray_shadow,
    "dark_boxes": lookalikes.dark_boxes,
    "terminal_blocks": panels.terminal_blocks,
    "pliers": tools.pliers,
}
"""What is no cable but may look like one, by name."""


def scene_plate(name: str, pool: TexturePool, seed: int = 7) -> ByteArray:
    """(216, 384, 3) RGB picture of a kind of :data:`SCENES`: of a few under ``seed`` the one with
    most cables seen."""
    scenes = [
        render_scene(np.random.default_rng([seed, k]), SCENES[name], pool) for k in range(_TRIED)
    ]
    return to_uint8(max(scenes, key=_worth).rgb)


def _worth(scene: Labelled) -> float:
    """Cables seen, less where the picture is very dark or very bright."""
    return len(scene.ids.unique()) - 20 * (float(scene.rgb.mean()) - 0.45) ** 2


def lookalike_plate(name: str, pool: TexturePool, seed: int = 7) -> ByteArray:
    """(216, 384, 3) RGB picture of a kind of :data:`LOOKALIKES` without any cable: of a few under
    ``seed`` one in which much of it is seen."""
    best, most = None, -1.0
    for k in range(_TRIED):
        rng = np.random.default_rng([seed, k])
        canvas = Canvas(pool.sample(rng, _SIZE, torch.device("cpu")).contiguous())
        ground = to_uint8(canvas.rgb).astype(float)
        LOOKALIKES[name](canvas, rng)
        picture = to_uint8(canvas.rgb)
        changed = float((np.abs(picture - ground).max(axis=2) > 20).mean())
        if min(changed, 0.3) > most:
            best, most = picture, min(changed, 0.3)
    assert best is not None
    return best
