"""One labelled picture from a generator: background, clutter, cables, things on top, camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from models.synthesis import truth
from models.synthesis.bundles import (
    Arrangement,
    Course,
    Layout,
    cut_through,
    fan,
    random_layout,
    ribbon_cable,
    wired,
)
from models.synthesis.cables import Cable, paint_cables
from models.synthesis.canvas import Canvas
from models.synthesis.clutter import Style, occluder, paint_clutter
from models.synthesis.curves import FloatArray
from models.synthesis.depth_of_field import blur_layer, blur_room, without_shadows
from models.synthesis.ends import terminal, tie
from models.synthesis.looks import Color, Look, random_color, random_light, random_look
from models.synthesis.optics import photograph
from models.synthesis.panels import terminal_row
from models.synthesis.stacking import Stack
from models.synthesis.textures import TexturePool


@dataclass(frozen=True)
class SceneParams:
    """``size`` (height, width) px; ``width_share`` bounds of a cable's width over the picture's
    width (6 to 60 px at 640); ``max_cables``; ``empty_share`` pictures without any; ``clutter`` how
    often there is some, and of which ``style``; ``cut_share`` cables whose ends face each other
    over a gap.

    Shares of pictures: ``air_share`` with the cables in the air before a room out of focus,
    ``fan_share`` with nearly straight strands side by side, ``ribbon_share`` with a flat cable,
    ``alike_share`` whose cables have the ground's own tone."""

    size: tuple[int, int] = (192, 320)
    width_share: tuple[float, float] = (0.008, 0.095)
    max_cables: int = 6
    empty_share: float = 0.1
    clutter: float = 0.8
    style: Style = "mixed"
    cut_share: float = 0.0
    air_share: float = 0.0
    fan_share: float = 0.0
    ribbon_share: float = 0.0
    alike_share: float = 0.0


WORKSHOP = SceneParams(
    width_share=(0.0045, 0.17),
    style="workshop",
    air_share=0.3,
    fan_share=0.2,
    ribbon_share=0.06,
    alike_share=0.12,
)
"""What photographs of workshops show: every kind of cable and of clutter."""


@dataclass(frozen=True)
class Labelled:
    """``rgb`` (3, H, W) float 0 to 1; ``ids`` (H, W) int16, 0 background, k the k-th cable where it
    is seen. Per cable ``centerlines`` (m, 3) x, y, height (of two strands that cross, the one on
    top has the larger), ``widths_px``, ``visible`` (m,) whether a sample is in the picture and on
    top. ``crossings`` in the picture, self-crossings too; ``camera`` with what it is worth."""

    rgb: Tensor
    ids: Tensor
    centerlines: tuple[FloatArray, ...]
    widths_px: tuple[float, ...]
    visible: tuple[NDArray[np.bool_], ...]
    crossings: tuple[truth.Crossing, ...]
    camera: truth.Camera


def render_scene(
    rng: np.random.Generator,
    params: SceneParams,
    pool: TexturePool,
    device: torch.device | None = None,
) -> Labelled:
    """Everything random comes from ``rng``: the same generator state gives the same picture."""
    device = device or torch.device("cpu")
    canvas = Canvas(pool.sample(rng, params.size, device).contiguous())
    if rng.random() < params.clutter:
        paint_clutter(canvas, rng, params.style)
    in_air = _happens(rng, params.air_share)
    if in_air:
        blur_room(canvas, rng)
    layout = _layout(canvas, rng, params)
    cables = random_cables(rng, layout, canvas.rgb, alike=_happens(rng, params.alike_share))
    light = random_light(rng)
    plan = paint_cables(canvas, cables, without_shadows(light) if in_air else light, rng)
    if in_air and rng.random() < 0.2:
        blur_layer(canvas, rng)
    for cable, course in zip(cables, layout.courses, strict=True):
        _finish_ends(canvas, rng, cable, course)
    for at, heading, half in layout.ties:
        tie(canvas, rng, at, heading, half)
    if rng.random() < 0.12:
        occluder(canvas, rng)
    rgb = photograph(canvas.rgb, rng)
    return _labelled(rgb, canvas, layout, plan, truth.random_camera(rng, params.size))


def to_uint8(rgb: Tensor) -> NDArray[np.uint8]:
    """(3, H, W) float to (H, W, 3) uint8."""
    return np.asarray((rgb.clamp(0, 1) * 255).round().byte().permute(1, 2, 0).cpu().numpy())


def random_cables(
    rng: np.random.Generator, layout: Layout, ground: Tensor, *, alike: bool = False
) -> list[Cable]:
    """Looks for the courses of a layout over ``ground`` (3, H, W), some (or, ``alike``, all) of
    whose colors they take."""
    # Colors are often the background's own: contrast is not what makes a cable.
    colors = (_ground_colors if alike else _colors)(rng, len(layout.courses), ground)
    looks = [
        random_look(rng, c, width) for c, (_, width) in zip(colors, layout.courses, strict=True)
    ]
    if layout.trunk is not None:
        looks[layout.trunk] = _wrapping(rng, looks[layout.trunk])
    return [_cable(rng, course, look) for course, look in zip(layout.courses, looks, strict=True)]


def _labelled(
    rgb: Tensor, canvas: Canvas, layout: Layout, plan: Stack, camera: truth.Camera
) -> Labelled:
    owner = torch.tensor(
        [0, *(p.cable + 1 for p in plan.pieces)], dtype=torch.int16, device=rgb.device
    )
    on_top = canvas.ids.cpu().numpy()
    curves = [
        np.column_stack([c[:, :2], z])
        for (c, _), z in zip(layout.courses, plan.heights, strict=True)
    ]
    return Labelled(
        rgb=rgb,
        ids=owner[canvas.ids.long()],
        centerlines=tuple(curves),
        widths_px=tuple(width for _, width in layout.courses),
        visible=tuple(truth.visible(plan, curve, k, on_top) for k, curve in enumerate(curves)),
        crossings=truth.crossings(plan, on_top),
        camera=camera,
    )


def _layout(canvas: Canvas, rng: np.random.Generator, params: SceneParams) -> Layout:
    if rng.random() < params.empty_share:
        return Layout(())
    if rng.random() < 0.1 * params.clutter:
        return _out_of_terminals(canvas, rng, params)
    arranged: Arrangement | None = None
    if _happens(rng, params.fan_share):
        arranged = fan
    elif _happens(rng, params.ribbon_share):
        arranged = ribbon_cable
    layout = random_layout(rng, params.size, params.width_share, params.max_cables, arranged)
    return cut_through(rng, layout, params.cut_share) if params.cut_share else layout


def _out_of_terminals(canvas: Canvas, rng: np.random.Generator, params: SceneParams) -> Layout:
    """A terminal row near an edge of the picture, its wire holes and the cables towards the
    middle."""
    height, width = params.size
    pitch, count = rng.uniform(0.03, 0.12) * width, int(rng.integers(1, params.max_cables + 1))
    heading = rng.uniform(-np.pi, np.pi)
    inward = np.array([np.cos(heading), np.sin(heading)])
    center = np.array([width / 2, height / 2]) - inward * (width, height) * rng.uniform(0.25, 0.5)
    # The holes are on the side away from the screws, which is where the cables leave.
    holes = terminal_row(canvas, rng, center, heading + np.pi / 2, pitch, count)
    return wired(rng, params.size, holes.astype(np.float32), heading, pitch)


def _colors(rng: np.random.Generator, n: int, ground: Tensor) -> list[Color]:
    identical = random_color(rng) if rng.random() < 0.3 else None
    colors = []
    for _ in range(n):
        color = identical or random_color(rng)
        colors.append(_ground_colors(rng, 1, ground)[0] if rng.random() < 0.18 else color)
    return colors


def _ground_colors(rng: np.random.Generator, n: int, ground: Tensor) -> list[Color]:
    """Colors of random pixels of the ground, a little off."""
    colors: list[Color] = []
    for _ in range(n):
        y, x = rng.integers(ground.shape[1]), rng.integers(ground.shape[2])
        seen = ground[:, y, x].cpu().numpy()
        red, green, blue = np.clip(seen + rng.normal(0, 0.04, 3), 0, 1).tolist()
        colors.append((red, green, blue))
    return colors


def _happens(rng: np.random.Generator, share: float) -> bool:
    """Draws nothing where the share is 0: scenes without the new kinds stay the same, byte for
    byte."""
    return share > 0 and rng.random() < share


def _wrapping(rng: np.random.Generator, look: Look) -> Look:
    """Tape, conduit or a braided sleeve, mostly black."""
    color: Color = (0.06, 0.06, 0.07) if rng.random() < 0.6 else look.color
    pattern = ("tape", "corrugated", "braid")[rng.integers(3)]
    return replace(look, color=color, second=(0.2, 0.2, 0.2), pattern=pattern, opacity=1.0)  # type: ignore[arg-type]


def _cable(rng: np.random.Generator, course: Course, look: Look) -> Cable:
    """Now and then with stripped ends, thinner than the insulation."""
    curve, width = course
    half = np.full(len(curve), width / 2, np.float32)
    bare = [int(rng.uniform(1.0, 4.0) * width) if rng.random() < 0.1 else 0 for _ in range(2)]
    first, last = (min(n, len(curve) // 4) for n in bare)
    half[:first] *= 0.6
    half[len(half) - last :] *= 0.6
    return Cable(curve, half, look, (first, last))


def _finish_ends(canvas: Canvas, rng: np.random.Generator, cable: Cable, course: Course) -> None:
    curve, width = course
    if len(curve) <= 12:
        return
    for end, inner, bare in (
        (curve[0], curve[6], cable.bare[0]),
        (curve[-1], curve[-7], cable.bare[1]),
    ):
        inside = 0 <= end[0] < canvas.width and 0 <= end[1] < canvas.height
        if inside and not bare and rng.random() < 0.4:
            heading = float(np.arctan2(end[1] - inner[1], end[0] - inner[0]))
            terminal(canvas, rng, end[:2], heading, width / 2)
