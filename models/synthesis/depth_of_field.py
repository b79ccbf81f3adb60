"""Things held in the air: a room out of focus behind them, and a second layer of cables a little
out of focus."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from models.synthesis.canvas import Canvas
from models.synthesis.looks import Light
from models.synthesis.optics import defocus

Rng = np.random.Generator


def blur_room(canvas: Canvas, rng: Rng) -> None:
    """What is on the canvas so far goes out of focus, by 0.2 to 2 % of the picture's width
    (standard deviation)."""
    canvas.rgb = defocus(
        canvas.rgb, float(np.exp(rng.uniform(np.log(0.002), np.log(0.02)))) * canvas.width
    )


def blur_layer(canvas: Canvas, rng: Rng) -> None:
    """Cables behind the focus: their edges are soft, and still theirs."""
    canvas.rgb = defocus(canvas.rgb, rng.uniform(0.5, 1.6))


def without_shadows(light: Light) -> Light:
    """Nothing behind the cables is near enough to take a shadow."""
    return replace(light, shadow=0.0, contact=0.0)
