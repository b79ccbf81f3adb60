"""Pictures of known 3D cables from known cameras: the truth that a reconstruction is measured
against.

Strategy: the table z = 0 carries a texture and is seen through its homography, so that all views
show the same ground. A cable is a dense curve with a radius; its samples are painted as short
strokes across their projection, the nearest to the camera on top, each pixel shaded as a cylinder.
Shadows are the cables' projections along the light onto the table, painted into the texture. The
picture is rendered twice as large and reduced, then blurred and given noise. Only NumPy and OpenCV;
everything random comes from the generator.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import cv2
import numpy as np

from models.geometry.arrays import ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.cameras import Camera, Intrinsics
from models.geometry.polylines import arc_lengths, resample

_TABLE_M = 1.2
"""Side of the square of table that has a texture, around the origin."""
_TEXELS = 1536
_SUPER = 2
_SHADOW_EDGE_M = 0.0015
_NEAREST_M = 0.02
_MOST_SAMPLES = 20_000
_WIDER = 2


@dataclass(frozen=True, eq=False)
class Cable3D:
    """``points_m`` (n, 3) dense centerline, ``radius_m``, ``color`` (3,) 0 to 1."""

    points_m: FloatArray
    radius_m: float
    color: tuple[float, float, float]


@dataclass(frozen=True)
class Optics:
    """``blur_px`` (sigma) and ``noise`` (of 1) of the camera; ``light`` direction to the lamp,
    ``ambient`` share."""

    blur_px: float = 0.6
    noise: float = 0.015
    light: tuple[float, float, float] = (0.35, -0.25, 0.9)
    ambient: float = 0.55
    shadow: float = 0.35
    gloss: float = 0.25


@dataclass(frozen=True, eq=False)
class Scene3D:
    """Cables over a table whose ``texture`` (h, w, 3) uint8 covers it once."""

    cables: tuple[Cable3D, ...]
    texture: ByteArray
    optics: Optics = field(default_factory=Optics)

    @cached_property
    def table(self) -> Float32Array:
        """(``_TEXELS``, ``_TEXELS``, 3) 0 to 1: the texture with the cables' shadows, the same from
        everywhere."""
        texture = (
            cv2.resize(self.texture, (_TEXELS, _TEXELS), interpolation=cv2.INTER_AREA).astype(
                np.float32
            )
            / 255
        )
        cover = np.zeros(texture.shape[:2], np.uint8)
        light = np.asarray(self.optics.light)
        for cable in self.cables:
            onto = cable.points_m[:, :2] - cable.points_m[:, 2:] * light[:2] / light[2]
            pixels = (onto / _TABLE_M + 0.5) * _TEXELS - 0.5
            thick = max(1, round(2 * cable.radius_m * _TEXELS / _TABLE_M))
            cv2.polylines(
                cover, [np.rint(pixels * 16).astype(np.int32)], False, 255, thick, cv2.LINE_AA, 4
            )
        soft = cv2.GaussianBlur(
            cover.astype(np.float32) / 255, (0, 0), _SHADOW_EDGE_M * _TEXELS / _TABLE_M
        )
        return np.asarray(texture * (1 - self.optics.shadow * soft)[:, :, None], np.float32)


@dataclass(frozen=True, eq=False)
class Rendered:
    """``rgb`` (H, W, 3) uint8; ``ids`` (H, W) 0 table, else the cable's number from 1; ``depth_m``
    (H, W) of the nearest cable surface, infinite beside cables."""

    rgb: ByteArray
    ids: IntArray
    depth_m: FloatArray


def random_cable(
    rng: np.random.Generator, length_m: float, *, bend: float = 3.0, rise_m: float = 0.04
) -> FloatArray:
    """(n, 3) smooth random centerline of about ``length_m`` around the origin, its main direction
    along y, between 5 mm and 5 mm + ``rise_m`` over the table. ``bend`` (1/m) scales the turning of
    its direction."""
    count = 2000
    along = np.linspace(0, length_m, count)
    heading, height = np.zeros(count), np.zeros(count)
    for wave in range(1, max(int(length_m * 8), 3) + 1):
        cycles = wave * 0.5 / length_m
        heading += rng.normal(0, bend / (2 * np.pi * cycles) / wave**0.5) * np.sin(
            2 * np.pi * cycles * along + rng.uniform(-np.pi, np.pi)
        )
        height += rng.normal(0, 1 / wave) * np.sin(
            2 * np.pi * cycles * along + rng.uniform(-np.pi, np.pi)
        )
    heading = 1.2 * np.tanh(heading / 1.2)
    flat = np.stack([np.sin(heading), np.cos(heading)], axis=1)
    xy = np.cumsum(flat, axis=0) * length_m / count
    height = (height - height.min()) / max(float(np.ptp(height)), 1e-9) * rng.uniform(
        0.4, 1.0
    ) * rise_m + 0.005
    middle = (xy.max(axis=0) + xy.min(axis=0)) / 2
    return np.concatenate([xy - middle, height[:, None]], axis=1)


def noise_texture(rng: np.random.Generator) -> ByteArray:
    """A speckled, slightly colored ground: detail at every scale, no lines."""
    base = rng.uniform(0.25, 0.8) + rng.normal(0, 0.05, 3)
    image = np.broadcast_to(base, (_TEXELS, _TEXELS, 3)).astype(np.float32).copy()
    for cells in (8, 32, 128, 512):
        grain = rng.normal(0, rng.uniform(0.015, 0.05), (cells, cells, 1)).astype(np.float32)
        image += cv2.resize(grain, (_TEXELS, _TEXELS), interpolation=cv2.INTER_CUBIC)[:, :, None]
    return np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)


def render(scene: Scene3D, camera: Camera, rng: np.random.Generator) -> Rendered:
    """What ``camera`` sees, lens distortion included. The camera stands over the table and looks
    down on it."""
    straight = _without_lens(camera)
    size = (straight.intrinsics.height, straight.intrinsics.width)
    larger = _enlarged(straight)
    rgb = _table(scene, larger)
    nearest = np.full(rgb.shape[:2], np.inf)
    ids = np.zeros(rgb.shape[:2], np.int64)
    for number, cable in enumerate(scene.cables, start=1):
        _paint(rgb, nearest, ids, cable, number, larger, scene.optics)
    rgb = np.asarray(cv2.resize(rgb, size[::-1], interpolation=cv2.INTER_AREA), np.float32)
    offset = _SUPER // 2
    ids, nearest = ids[offset::_SUPER, offset::_SUPER], nearest[offset::_SUPER, offset::_SUPER]
    if camera.intrinsics.distorted:
        rgb, ids, nearest = _bend(camera, straight, rgb, ids, nearest)
    if scene.optics.blur_px > 0:
        rgb = np.asarray(cv2.GaussianBlur(rgb, (0, 0), scene.optics.blur_px), np.float32)
    noisy = rgb + scene.optics.noise * rng.standard_normal(rgb.shape, dtype=np.float32)
    return Rendered(np.rint(np.clip(noisy, 0, 1) * 255).astype(np.uint8), ids, nearest)


def _without_lens(camera: Camera) -> Camera:
    """The pinhole whose picture holds all that the lens shows, up to ``_WIDER`` times its size to
    each side."""
    i = camera.intrinsics
    if not i.distorted:
        return camera
    x, y = np.meshgrid(np.linspace(0, i.width - 1, 40), np.linspace(0, i.height - 1, 40))
    ideal = camera.undistort(np.stack([x.ravel(), y.ravel()], axis=1))
    limit = _WIDER * np.array([i.width, i.height])
    ideal = np.clip(ideal[np.isfinite(ideal).all(axis=1)], -limit, 2 * limit)
    low = np.floor(np.minimum(ideal.min(axis=0), 0)) - 1
    high = np.ceil(np.maximum(ideal.max(axis=0), (i.width - 1, i.height - 1))) + 1
    width, height = (high - low).astype(int) + 1
    middle = (i.cx - float(low[0]), i.cy - float(low[1]))
    return replace(camera, intrinsics=Intrinsics(int(width), int(height), i.fx, i.fy, *middle))


def _enlarged(camera: Camera) -> Camera:
    """``_SUPER`` times as many pixels; pixel centers at (k + 0.5) s - 0.5."""
    i, s = camera.intrinsics, _SUPER
    middle = ((i.cx + 0.5) * s - 0.5, (i.cy + 0.5) * s - 0.5)
    return Camera(
        Intrinsics(i.width * s, i.height * s, i.fx * s, i.fy * s, *middle), camera.T_world_camera
    )


def _table(scene: Scene3D, camera: Camera) -> Float32Array:
    """(H, W, 3) the table as the camera sees it, through the homography of its plane."""
    scale = _TEXELS / _TABLE_M
    # texel to table (meters, z = 0) to pixel
    corner = 0.5 / scale - _TABLE_M / 2
    to_table = np.array([[1 / scale, 0, corner], [0, 1 / scale, corner], [0, 0, 1]])
    pose = np.concatenate(
        [camera.rotation.T[:, :2], -(camera.rotation.T @ camera.center)[:, None]], axis=1
    )
    homography = camera.intrinsics.matrix @ pose @ to_table
    size = (camera.intrinsics.width, camera.intrinsics.height)
    seen = cv2.warpPerspective(
        scene.table, homography, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    return np.asarray(seen, np.float32)


def _paint(
    rgb: Float32Array,
    nearest: FloatArray,
    ids: IntArray,
    cable: Cable3D,
    number: int,
    camera: Camera,
    optics: Optics,
) -> None:
    """The surface's samples, the nearest to the camera in each pixel, over what is painted
    already."""
    surface, color = _surface(cable, camera, optics)
    pixels, depth = camera.project(surface), camera.in_camera(surface)[:, 2]
    at = np.rint(np.where(np.isfinite(pixels), pixels, -1)).astype(np.int64)
    inside = (at >= 0).all(axis=-1) & (at[:, 0] < rgb.shape[1]) & (at[:, 1] < rgb.shape[0])
    flat = (at[:, 1] * rgb.shape[1] + at[:, 0])[inside]
    order = np.argsort(-depth[inside], kind="stable")
    flat, depth, color = flat[order], depth[inside][order], color[inside][order]
    last = np.full(ids.size, -1)
    last[flat] = np.arange(len(flat))
    pixel = np.flatnonzero(last >= 0)
    pick = last[pixel]
    above = depth[pick] < nearest.reshape(-1)[pixel]
    pixel, pick = pixel[above], pick[above]
    rgb.reshape(-1, 3)[pixel] = color[pick]
    nearest.reshape(-1)[pixel] = depth[pick]
    ids.reshape(-1)[pixel] = number


def _surface(cable: Cable3D, camera: Camera, optics: Optics) -> tuple[FloatArray, FloatArray]:
    """(s, 3) points of the cable's visible half, about two thirds of a pixel apart in both
    directions, and their (s, 3) colors."""
    points = _dense(cable.points_m, camera)
    tangent = _unit(np.gradient(points, axis=0))
    sight = _unit(points - camera.center)
    side = _unit(np.cross(tangent, sight))
    front = np.cross(side, tangent)
    front *= -np.sign(np.einsum("ni,ni->n", front, sight))[:, None]
    widest = 2 * cable.radius_m * camera.focal_px / camera.in_camera(points)[:, 2].min()
    across = np.linspace(-1, 1, int(np.ceil(widest / 0.6)) + 1)
    rise = np.sqrt(1 - across**2)
    outward = across[:, None] * side[:, None] + rise[:, None] * front[:, None]
    surface = points[:, None] + cable.radius_m * outward
    return surface.reshape(-1, 3), _shade(outward, rise, front, cable.color, optics).reshape(-1, 3)


def _dense(points: FloatArray, camera: Camera) -> FloatArray:
    """The part in front of the camera, resampled so that neighbors are about two thirds of a pixel
    apart."""
    points = points[camera.in_camera(points)[:, 2] > _NEAREST_M]
    if len(points) < 2:
        raise ValueError("the cable is not in front of the camera")
    depth = float(camera.in_camera(points)[:, 2].min())
    count = int(arc_lengths(points)[-1] * camera.focal_px / depth / 0.6) + 2
    return resample(points, min(count, _MOST_SAMPLES))


def _unit(vectors: FloatArray) -> FloatArray:
    unit: FloatArray = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return unit


def _shade(
    normal: FloatArray,
    rise: FloatArray,
    front: FloatArray,
    color: tuple[float, float, float],
    optics: Optics,
) -> FloatArray:
    """(n, a, 3) a cylinder of (n, a, 3) normals under one lamp, with a highlight."""
    light = np.asarray(optics.light) / np.linalg.norm(optics.light)
    lambert = np.clip(normal @ light, 0, 1)
    half = _unit(light + front)
    shine = np.clip(np.einsum("nai,ni->na", normal, half), 0, 1) ** 20
    base = optics.ambient * (0.8 + 0.2 * rise) + (1 - optics.ambient) * 1.2 * lambert
    out: FloatArray = base[..., None] * np.asarray(color) + optics.gloss * shine[..., None]
    return out


@lru_cache(maxsize=2)
def _seen_at(i: Intrinsics) -> FloatArray:
    """(H·W, 2) ideal pixel of every pixel; kept, for many views of a scene share a lens."""
    x, y = np.meshgrid(np.arange(i.width, dtype=np.float64), np.arange(i.height, dtype=np.float64))
    return Camera(i, np.eye(4)).undistort(np.stack([x.ravel(), y.ravel()], axis=1))


def _bend(
    camera: Camera, straight: Camera, rgb: Float32Array, ids: IntArray, depth: FloatArray
) -> tuple[Float32Array, IntArray, FloatArray]:
    """The picture of the pinhole ``straight`` as the lens of ``camera`` shows it."""
    i, wide = camera.intrinsics, straight.intrinsics
    ideal = _seen_at(i) + np.array([wide.cx - i.cx, wide.cy - i.cy])
    place = np.nan_to_num(ideal, nan=-1.0).astype(np.float32).reshape(i.height, i.width, 2)
    warped = cv2.remap(
        rgb, place[..., 0], place[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT
    )
    near = np.rint(place).astype(np.int64).clip(0, (wide.width - 1, wide.height - 1))
    return (
        np.asarray(warped, np.float32),
        ids[near[..., 1], near[..., 0]],
        depth[near[..., 1], near[..., 0]],
    )
