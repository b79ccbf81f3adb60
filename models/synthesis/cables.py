"""Painting cables over a canvas: their shadows, then their pieces from the lowest to the
highest."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from models.synthesis.canvas import Canvas, blur
from models.synthesis.curves import FloatArray
from models.synthesis.looks import Light, Look, Rng, appearance
from models.synthesis.ribbons import Ribbon, Strand, rasterize, strand
from models.synthesis.stacking import Stack, stack

_LIFT = 3.0  # a strand at height 1 is this many half-widths above the table
_SHADOW_SCALE = 0.5  # shadows are soft: they are painted at half resolution


@dataclass(frozen=True)
class Cable:
    """``curve`` (m, 3) dense x, y, height 0 to 1; ``half_width`` (m,) px; ``bare`` samples of bare
    copper at either end."""

    curve: FloatArray
    half_width: FloatArray
    look: Look
    bare: tuple[int, int] = (0, 0)


def paint_cables(canvas: Canvas, cables: Sequence[Cable], light: Light, rng: Rng) -> Stack:
    """Afterwards ``canvas.ids`` holds k + 1 where piece k of the returned stack is on top."""
    plan = stack([c.curve for c in cables], [float(c.half_width.max()) for c in cables])
    strands = [strand(c.curve, c.half_width, canvas.rgb.device) for c in cables]
    heights = [torch.as_tensor(h, device=canvas.rgb.device) for h in plan.heights]
    _shadow_on_ground(canvas, list(zip(strands, heights, strict=True)), light)
    passes_over: dict[int, list[tuple[int, int]]] = defaultdict(list)
    for meeting in plan.meetings:
        over, under = plan.over_and_under(meeting)
        passes_over[plan.rank(*over)].append((over[1], plan.rank(*under)))
    for k, piece in enumerate(plan.pieces):
        for sample, below in passes_over[k]:
            _shadow_below(canvas, strands[piece.cable], sample, below + 1, light)
        # A sample more at the start closes the seam to the neighbor.
        part = strands[piece.cable].cut(piece.start - 1, piece.stop)
        ribbon = _paint(canvas, part, cables[piece.cable].look, light, rng)
        canvas.ids.view(-1)[ribbon.index[ribbon.alpha > 0.5]] = k + 1
        for bare in _bare_ends(cables[piece.cable], strands[piece.cable], piece.start, piece.stop):
            _paint(canvas, bare, _copper(cables[piece.cable].look), light, rng)
    return plan


def paint_thing(
    canvas: Canvas, curve: FloatArray, half_width: FloatArray, look: Look, light: Light, rng: Rng
) -> None:
    """Something long that is not a cable: painted in one go, without a label."""
    whole = strand(curve, half_width, canvas.rgb.device)
    _shadow_on_ground(canvas, [(whole, torch.zeros(len(curve), device=whole.xy.device))], light)
    _paint(canvas, whole, look, light, rng)


def _paint(canvas: Canvas, part: Strand, look: Look, light: Light, rng: Rng) -> Ribbon:
    ribbon = rasterize(part, canvas.size)
    if len(ribbon.index):
        color, alpha = appearance(ribbon, look, light, part.first, rng)
        flat = canvas.rgb.view(3, -1)
        below = flat[:, ribbon.index]
        flat[:, ribbon.index] = below + alpha * (color - below)
    return ribbon


def _shadow_on_ground(
    canvas: Canvas, strands: Sequence[tuple[Strand, Tensor]], light: Light
) -> None:
    """One soft cast shadow, the farther from its strand the higher that lies, and a tight one in
    contact."""
    if not strands or max(light.shadow, light.contact) < 0.04:
        return
    half = max(float(s.half.mean()) for s, _ in strands)
    if light.contact >= 0.04:
        near = [replace(s, half=s.half * 1.25) for s, _ in strands]
        canvas.darken(soft_cover(canvas, near, round(0.35 * half)), light.contact)
    if light.shadow >= 0.04:
        toward = torch.tensor(light.direction[:2], device=canvas.rgb.device)
        cast = [
            replace(s, xy=s.xy - toward * (s.half * (0.6 + _LIFT * z))[:, None]) for s, z in strands
        ]
        canvas.darken(soft_cover(canvas, cast, light.softness + round(0.3 * half)), light.shadow)


def soft_cover(canvas: Canvas, strands: Sequence[Strand], softness_px: int) -> Tensor:
    """(H, W) blurred union of strands, 0 to 1."""
    size = (canvas.height + 1) // 2, (canvas.width + 1) // 2
    cover = torch.zeros(size[0] * size[1], device=canvas.rgb.device)
    for one in strands:
        ribbon = rasterize(one.scaled(_SHADOW_SCALE), size)
        cover[ribbon.index] = torch.maximum(cover[ribbon.index], ribbon.alpha)
    small = blur(cover.view(size), round(softness_px * _SHADOW_SCALE))
    large = torch.nn.functional.interpolate(small[None, None], scale_factor=2, mode="bilinear")[
        0, 0
    ]
    return large[: canvas.height, : canvas.width]


def _shadow_below(canvas: Canvas, upper: Strand, sample: int, below: int, light: Light) -> None:
    """What the strand that passes over at ``sample`` throws on piece number ``below``, fading along
    it."""
    strength = min(light.shadow + light.contact, 0.8)
    half = float(upper.half[min(sample, len(upper.half) - 1)])
    if strength < 0.04 or half < 1.0:
        return
    local = upper.cut(sample - int(6 * half), sample + int(6 * half))
    reach = 0.8 * half
    fade = torch.linspace(-1, 1, len(local.half), device=local.half.device).square().neg() + 1
    toward = torch.tensor(light.direction[:2], device=local.xy.device)
    wide = replace(local, xy=local.xy - toward * reach, half=(local.half + reach) * fade)
    ribbon = rasterize(wide, canvas.size)
    here = canvas.ids.view(-1)[ribbon.index] == below
    index = ribbon.index[here]
    profile = (2 * (1 - ribbon.offset[here].abs())).clamp_(max=1)
    canvas.rgb.view(3, -1)[:, index] *= 1 - strength * profile * ribbon.alpha[here]


def _bare_ends(cable: Cable, whole: Strand, start: int, stop: int) -> list[Strand]:
    """Thinner strands over the ends of the samples ``start`` to ``stop``, where the insulation is
    off."""
    total = len(cable.curve)
    ends = ((0, cable.bare[0]), (total - cable.bare[1], total))
    spans = [(max(a, start), min(b, stop)) for a, b in ends]
    return [whole.cut(a, b) for a, b in spans if b - a > 2]


def _copper(look: Look) -> Look:
    return replace(
        look,
        color=(0.72, 0.42, 0.22),
        second=(0.95, 0.7, 0.45),
        pattern="helix",
        period_px=4.0,
        gloss=0.6,
        shininess=12.0,
        opacity=1.0,
        window=0.0,
    )
