"""What a DLO looks like: light, insulation colors, patterns, relief, gloss, transparency."""

from __future__ import annotations

import colorsys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from models.synthesis.ribbons import STEP_PX, Ribbon

Rng = np.random.Generator
Color = tuple[float, float, float]
Pattern = Literal[
    "plain", "stripe", "helix", "bands", "print", "braid", "corrugated", "tape", "twist"
]

# Hue, saturation and value bands of common insulation colors; drawn with equal chance.
_PALETTE = (
    ((0.55, 0.63), (0.7, 1.0), (0.35, 0.9)),  # blue
    ((0.54, 0.60), (0.15, 0.5), (0.7, 1.0)),  # light blue
    ((0.97, 1.02), (0.7, 1.0), (0.4, 0.9)),  # red
    ((0.13, 0.17), (0.6, 1.0), (0.7, 1.0)),  # yellow
    ((0.03, 0.09), (0.6, 1.0), (0.6, 1.0)),  # orange
    ((0.05, 0.10), (0.4, 0.8), (0.25, 0.6)),  # brown, copper
    ((0.25, 0.42), (0.4, 1.0), (0.25, 0.85)),  # green
    ((0.0, 1.0), (0.0, 0.12), (0.75, 1.0)),  # white
    ((0.02, 0.12), (0.05, 0.3), (0.75, 1.0)),  # ivory, skin
    ((0.0, 1.0), (0.0, 0.2), (0.3, 0.7)),  # gray
    ((0.0, 1.0), (0.0, 0.3), (0.03, 0.2)),  # black
    ((0.0, 1.0), (0.0, 1.0), (0.1, 1.0)),  # anything
)
_PATTERNS: tuple[tuple[Pattern, float], ...] = (
    ("plain", 0.60),
    ("stripe", 0.09),
    ("helix", 0.05),
    ("bands", 0.03),
    ("print", 0.08),
    ("braid", 0.05),
    ("corrugated", 0.03),
    ("tape", 0.03),
    ("twist", 0.04),
)


@dataclass(frozen=True)
class Light:
    """``direction`` (3,) unit vector to the lamp, ``ambient`` 0 (one hard lamp) to 1 (flat),
    ``shadow`` and ``contact`` how dark shadows are apart from and below a strand, ``softness`` px,
    ``color`` (3,)."""

    direction: tuple[float, float, float]
    ambient: float
    shadow: float
    softness: int
    color: Color
    contact: float = 0.0


@dataclass(frozen=True)
class Look:
    """Surface of one DLO: two colors and the pattern they form (``period_px`` long, starting at
    ``turn_rad`` around the strand); ``gloss`` and ``shininess`` of the lamp's reflection,
    ``window`` 0 to 1 for a sharp ribbon-like one; ``grain`` noise; ``opacity`` below 1 lets the
    ground through, less so at the rim."""

    color: Color
    second: Color
    pattern: Pattern
    period_px: float
    gloss: float
    shininess: float
    grain: float
    opacity: float
    window: float = 0.0
    turn_rad: float = 0.0


def random_color(rng: Rng) -> Color:
    hue, saturation, value = (rng.uniform(*band) for band in _PALETTE[rng.integers(len(_PALETTE))])
    return colorsys.hsv_to_rgb(hue % 1.0, saturation, value)


def random_gray(rng: Rng, low: float = 0.02, high: float = 1.0) -> Color:
    red, green, blue = np.clip(rng.uniform(low, high) + rng.normal(0, 0.03, 3), 0, 1).tolist()
    return red, green, blue


def flat_look(color: Color) -> Look:
    """Paint or ink: no pattern, no gloss."""
    return Look(color, color, "plain", 10.0, gloss=0.0, shininess=4.0, grain=0.0, opacity=1.0)


def random_look(rng: Rng, color: Color, width_px: float) -> Look:
    names, shares = zip(*_PATTERNS, strict=True)
    pattern: Pattern = names[rng.choice(len(names), p=shares)]
    fine = pattern in ("braid", "corrugated")
    return Look(
        color=color,
        second=_second_color(rng, color, pattern),
        pattern=pattern,
        period_px=max(
            float(width_px * (rng.uniform(0.35, 0.9) if fine else rng.uniform(1.5, 8.0))), 3.0
        ),
        gloss=float(rng.choice([0.0, rng.uniform(0.05, 0.3), rng.uniform(0.3, 0.9)])),
        shininess=float(np.exp(rng.uniform(np.log(4), np.log(120)))),
        grain=float(rng.choice([0.0, rng.uniform(0.0, 0.12)])),
        opacity=float(rng.uniform(0.35, 0.85)) if rng.random() < 0.04 else 1.0,
        window=float(rng.uniform(0.3, 1.0)) if rng.random() < 0.25 else 0.0,
        turn_rad=float(rng.uniform(-1.2, 1.2)),
    )


def random_light(rng: Rng) -> Light:
    azimuth, tilt = rng.uniform(-np.pi, np.pi), rng.uniform(0.15, 1.1)
    warmth = rng.normal(0.0, 0.06)
    ambient = float(
        rng.choice([rng.uniform(0.25, 0.6), rng.uniform(0.6, 0.9), rng.uniform(0.9, 1.0)])
    )
    return Light(
        direction=(
            float(np.sin(tilt) * np.cos(azimuth)),
            float(np.sin(tilt) * np.sin(azimuth)),
            float(np.cos(tilt)),
        ),
        ambient=ambient,
        shadow=float(rng.uniform(0.05, 0.75) * (1.15 - ambient)),
        softness=int(rng.integers(0, 6)),
        color=(1 + warmth, 1.0, 1 - warmth),
        contact=float(rng.choice([0.0, rng.uniform(0.1, 0.6)])),
    )


def appearance(
    ribbon: Ribbon, look: Look, light: Light, first: int, rng: Rng
) -> tuple[Tensor, Tensor]:
    """Color (3, P) after light, and coverage (P,), of the pixels of a strand whose first sample is
    ``first``."""
    along = (ribbon.sample + first) * (STEP_PX / look.period_px)
    up = (1 - ribbon.offset.square()).clamp_(min=0).sqrt_()
    normal = ribbon.normal * ribbon.offset
    color, relief = _surface(ribbon, look, along)
    shade = _shade(normal, up, light) * relief
    if look.grain > 0:
        noise = torch.as_tensor(rng.standard_normal(len(up), dtype=np.float32), device=up.device)
        shade = shade * (1 + look.grain * noise)
    color = color * shade
    if look.gloss > 0:
        color = color + look.gloss * _highlight(normal, up, look, light)
    alpha = ribbon.alpha
    if look.opacity < 1:
        alpha = alpha * (look.opacity + (1 - look.opacity) * (1 - up).square())
    return color * color.new_tensor(light.color)[:, None], alpha


def wrapped_texture(look: Look, length_px: float, around: int = 32) -> np.ndarray:
    """The insulation unrolled, before light: (n, around, 3), rows two pixels apart along the
    strand, columns once around it; column ``around`` / 2 faces up."""
    along = torch.arange(0, max(length_px, 4.0), 2.0)[:, None].expand(-1, around) / look.period_px
    angle = torch.linspace(-torch.pi, torch.pi, around).expand(len(along), -1)
    share, relief = torch.zeros(1), torch.ones(1)
    if look.pattern != "plain":
        share, factor = _PATTERN[look.pattern](2 * torch.pi * along, angle - look.turn_rad)
        relief = torch.as_tensor(factor)
    base, second = torch.tensor(look.color), torch.tensor(look.second)
    color = (base + share[..., None] * (second - base)) * relief[..., None]
    return color.clamp(0, 1).expand(*along.shape, 3).numpy()


def _surface(ribbon: Ribbon, look: Look, along: Tensor) -> tuple[Tensor, Tensor | float]:
    """Color before light, (3, 1) or (3, P), and the factor by which relief changes the
    brightness."""
    base = along.new_tensor(look.color)[:, None]
    if look.pattern == "plain":
        return base, 1.0
    share, relief = _PATTERN[look.pattern](
        2 * torch.pi * along, torch.asin(ribbon.offset) - look.turn_rad
    )
    return base + share * (base.new_tensor(look.second)[:, None] - base), relief


def _stripe(phase: Tensor, angle: Tensor) -> tuple[Tensor, Tensor | float]:
    return ((angle + 0.4 * torch.sin(0.1 * phase)).abs() < 0.45).float(), 1.0


def _helix(phase: Tensor, angle: Tensor) -> tuple[Tensor, Tensor | float]:
    return (torch.sin(phase + angle) > 0.3).float(), 1.0


def _bands(phase: Tensor, angle: Tensor) -> tuple[Tensor, Tensor | float]:
    return (torch.sin(phase) > 0.6).float(), 1.0


def _print(phase: Tensor, angle: Tensor) -> tuple[Tensor, Tensor | float]:
    marks = torch.sin(1.5 * phase) + torch.sin(3.7 * phase) > 0.4
    return 0.7 * (marks & (angle.abs() < 0.35)).float(), 1.0


def _braid(phase: Tensor, angle: Tensor) -> tuple[Tensor, Tensor | float]:
    left, right = torch.sin(phase + 3 * angle), torch.sin(phase - 3 * angle)
    return (left * right > 0.15).float(), 1.0 - 0.35 * (left * right < -0.4).float()


def _corrugated(phase: Tensor, angle: Tensor) -> tuple[Tensor, Tensor | float]:
    return torch.zeros_like(phase), 0.75 + 0.4 * torch.sin(phase)


def _tape(phase: Tensor, angle: Tensor) -> tuple[Tensor, Tensor | float]:
    turn = torch.remainder((phase + angle) / (2 * torch.pi), 1.0)
    return torch.zeros_like(phase), 0.85 + 0.2 * turn - 0.35 * (turn < 0.08).float()


def _twist(phase: Tensor, angle: Tensor) -> tuple[Tensor, Tensor | float]:
    wave = torch.sin(phase + 1.3 * angle)
    return (wave > 0).float(), 0.45 + 0.6 * wave.abs().clamp(max=1.0).sqrt()


_PATTERN: dict[Pattern, Callable[[Tensor, Tensor], tuple[Tensor, Tensor | float]]] = {
    "stripe": _stripe,
    "helix": _helix,
    "bands": _bands,
    "print": _print,
    "braid": _braid,
    "corrugated": _corrugated,
    "tape": _tape,
    "twist": _twist,
}
"""Per pattern: phase along the strand and angle around it (P,) to the second color's share and the
relief."""


def _shade(normal: Tensor, up: Tensor, light: Light) -> Tensor:
    """(P,) Lambert term of a cylinder; ``ambient`` 1 leaves only a faint darkening at the rim."""
    lx, ly, lz = light.direction
    lambert = (normal[0] * lx + normal[1] * ly + up * lz).clamp_(min=0)
    return light.ambient * (0.85 + 0.15 * up) + (1 - light.ambient) * 1.25 * lambert


def _highlight(normal: Tensor, up: Tensor, look: Look, light: Light) -> Tensor:
    """Reflection of the lamp (Blinn), or of a window: a band with sharp edges along the strand."""
    lx, ly, lz = light.direction
    scale = 1.0 / np.sqrt(lx**2 + ly**2 + (lz + 1) ** 2)
    half = ((normal[0] * lx + normal[1] * ly + up * (lz + 1)) * scale).clamp_(min=0)
    soft = half**look.shininess
    if look.window == 0:
        return soft
    return soft + look.window * ((half - 0.5 ** (2 / look.shininess)) * 2 * look.shininess).clamp(
        0, 1
    )


def _second_color(rng: Rng, color: Color, pattern: Pattern) -> Color:
    """Braids and prints stay near their own color, dark or light; green comes with yellow (earth
    wires)."""
    if pattern == "braid" and rng.random() < 0.7:
        red, green, blue = (np.asarray(color) * rng.uniform(0.4, 1.4)).clip(0, 1).tolist()
        return red, green, blue
    if pattern in ("stripe", "twist") and color[1] > max(color[0], color[2]) and rng.random() < 0.6:
        return 0.9, 0.8, 0.1
    return random_color(rng)
