"""Things that are not cables: which kinds of clutter stand in a picture, and how many.

Each painter takes a canvas and a generator and paints one kind of clutter; sizes are in shares of
the picture's width W, so that the same scene can be rendered at any size.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from models.synthesis.boards import board
from models.synthesis.canvas import Canvas
from models.synthesis.lookalikes import LOOKALIKES, dark_boxes
from models.synthesis.looks import random_gray
from models.synthesis.paint import mosaic, mural, splatter
from models.synthesis.panels import (
    din_rail,
    duct,
    grid,
    keyboard,
    label,
    panel,
    perforated,
    rails,
    terminal_blocks,
)
from models.synthesis.surfaces import bars_of_shadow, folds, glare, seams, tiles, wood_grain
from models.synthesis.tools import pliers, rods, screwdriver, wrench

Rng = np.random.Generator
Painter = Callable[[Canvas, Rng], None]
Style = Literal["mixed", "plain", "busy", "industrial", "workshop"]

# What is taken for a cable most often comes most often: joints, rods, thrown paint.
PAINTERS: tuple[Painter, ...] = (
    *(seams, seams, seams, tiles, folds, wood_grain, bars_of_shadow, glare),
    *(panel, panel, grid, perforated, keyboard, board),
    *(rails, rails, din_rail, duct, terminal_blocks, terminal_blocks),
    *(label, label),
    *(rods, rods, rods, rods, wrench, screwdriver, pliers),
    *(splatter, splatter, splatter, mosaic),
)
_INDUSTRIAL: tuple[Painter, ...] = (
    rails,
    din_rail,
    duct,
    panel,
    panel,
    terminal_blocks,
    label,
    rods,
)

_WORKSHOP: tuple[Painter, ...] = (*PAINTERS, *LOOKALIKES, *LOOKALIKES, dark_boxes, dark_boxes)


def paint_clutter(canvas: Canvas, rng: Rng, style: Style) -> None:
    """What stands in the background: nothing, thrown paint, machine parts, or up to four of
    anything."""
    match style:
        case "plain":
            return
        case "busy":
            mural(canvas, rng)
        case "industrial":
            for painter in _INDUSTRIAL:
                painter(canvas, rng)
        case "workshop":
            for _ in range(rng.choice([0, 1, 2, 3, 4], p=[0.15, 0.25, 0.25, 0.2, 0.15])):
                _WORKSHOP[rng.integers(len(_WORKSHOP))](canvas, rng)
        case "mixed":
            for _ in range(rng.choice([0, 1, 2, 3, 4], p=[0.12, 0.26, 0.28, 0.2, 0.14])):
                PAINTERS[rng.integers(len(PAINTERS))](canvas, rng)


def occluder(canvas: Canvas, rng: Rng) -> None:
    """Something that lies over the cables: a strap, a label, a part."""
    w = canvas.width
    at = rng.uniform((0, 0), (w, canvas.height))
    half = rng.uniform((0.01 * w, 0.01 * w), (0.12 * w, 0.05 * w))
    angle = rng.uniform(-np.pi, np.pi)
    canvas.box(at + 0.01 * w, half, angle, (0, 0, 0), opacity=0.25)
    canvas.box(at, half, angle, random_gray(rng), bevel=rng.uniform(-0.4, 0.4), covers=True)
