"""Pictures of a shape control task: an animation of the rope, and error and parameters over the
actions (Fig. 5.7).

Needs Pillow (the ``cli`` extra).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw

from dlo_client.demo.simulated_table import extent
from dlo_client.shape_control import Points, ShapeOutcome

_SIZE = (640, 480)
_PANEL = (640, 190)
_MARGIN = 48
_INK, _SOFT, _ROPE, _TARGET, _LIMIT = "#1b1f27", "#9aa3b2", "#1f6fd6", "#16803c", "#b42318"


def animate(frames: Sequence[Points], target: Points, path: Path) -> None:
    """A GIF of the rope moving over the outline of the target; at most about 200 pictures."""
    kept = [*frames[:: max(1, len(frames) // 200)], frames[-1]]
    low_x, low_y, high_x, high_y = extent([*kept, target])
    scale = min(
        (_SIZE[0] - 40) / max(high_x - low_x, 1e-6), (_SIZE[1] - 40) / max(high_y - low_y, 1e-6)
    )
    middle = ((low_x + high_x) / 2, (low_y + high_y) / 2)

    def to_pixels(points: Points) -> list[tuple[float, float]]:
        cx, cy = _SIZE[0] / 2, _SIZE[1] / 2
        return [(cx + scale * (x - middle[0]), cy - scale * (y - middle[1])) for x, y in points]

    pictures = []
    for points in kept:
        picture = Image.new("RGB", _SIZE, "white")
        draw = ImageDraw.Draw(picture)
        draw.line(to_pixels(target), fill="#bfe3cc", width=12, joint="curve")
        draw.line(to_pixels(points), fill=_ROPE, width=6, joint="curve")
        for x, y in to_pixels(points):
            draw.ellipse((x - 4, y - 4, x + 4, y + 4), fill=_INK)
        pictures.append(picture)
    pictures[0].save(
        path,
        save_all=True,
        append_images=pictures[1:],
        duration=[50] * (len(pictures) - 1) + [2000],
        loop=0,
    )


def plot(outcome: ShapeOutcome, threshold_m: float, path: Path) -> None:
    """Three panels over the number of actions: mean error in mm with the threshold, k_b and k_d."""
    errors = [1e3 * error for error in outcome.errors_m]
    panels = [
        ("mean error, mm", errors, 1e3 * threshold_m),
        ("k_b", [p.k_b for p in outcome.parameters], None),
        ("k_d", [p.k_d for p in outcome.parameters], None),
    ]
    picture = Image.new("RGB", (_PANEL[0], _PANEL[1] * len(panels)), "white")
    draw = ImageDraw.Draw(picture)
    for k, (title, values, line) in enumerate(panels):
        _panel(draw, k * _PANEL[1], title, values, line)
    picture.save(path)


def _panel(
    draw: ImageDraw.ImageDraw, top: int, title: str, values: Sequence[float], line: float | None
) -> None:
    highest = _round_up(max([*values, line or 0.0, 1e-9]))
    left, right, base = _MARGIN, _PANEL[0] - 16, top + _PANEL[1] - 28

    def at(step: int, value: float) -> tuple[float, float]:
        x = left + (right - left) * step / max(len(values) - 1, 1)
        return x, base - (base - top - 30) * value / highest

    draw.line([(left, top + 24), (left, base), (right, base)], fill=_INK)
    draw.text((left, top + 6), title, fill=_INK)
    for share in (0.0, 0.5, 1.0):
        y = at(0, share * highest)[1]
        draw.text((6, y - 6), f"{share * highest:.3g}", fill=_SOFT)
    for step in range(len(values)):
        draw.text((at(step, 0)[0] - 3, base + 6), str(step), fill=_SOFT)
    if line is not None:
        draw.line([at(0, line), (right, at(0, line)[1])], fill=_LIMIT)
    points = [at(step, value) for step, value in enumerate(values)]
    draw.line(points, fill=_ROPE, width=2)
    for x, y in points:
        draw.ellipse((x - 3, y - 3, x + 3, y + 3), fill=_ROPE)


def _round_up(value: float) -> float:
    """The next of 1, 2, 5 × 10^k."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(step * power for step in (1, 2, 5, 10) if value <= step * power * (1 + 1e-9))
