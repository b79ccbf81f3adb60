"""The photo-real renderer: the same cables as tubes over a textured table, path traced through a
pinhole.

An optional extra (``requirements/photoreal.in``); same interface and labels as
``scenes.render_scene``, but the camera is tilted and has parallax, shadows and reflections are the
scene's own. Labels come from the traced scene: ids from the shape that a ray through the pixel's
center meets, order at crossings from the distances to the camera.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from models.synthesis.bundles import random_layout
from models.synthesis.cables import Cable
from models.synthesis.canvas import Canvas
from models.synthesis.clutter import paint_clutter
from models.synthesis.curves import FloatArray
from models.synthesis.looks import Look, wrapped_texture
from models.synthesis.optics import photograph
from models.synthesis.scenes import Labelled, SceneParams, random_cables
from models.synthesis.stacking import intersections, stack
from models.synthesis.textures import TexturePool
from models.synthesis.truth import Camera, Crossing, random_camera
from models.synthesis.tubes import resting_heights, sweep

_GAMMA = 2.2
_TABLE = (
    3.0  # the table is this many times as large as the picture; its texture is mirrored beyond 1
)
_THINNED = 4  # one ring of vertices for so many curve samples


class PathTracerMissingError(RuntimeError):
    """mitsuba is not installed."""


def render_path_traced(
    rng: np.random.Generator, params: SceneParams, pool: TexturePool, *, samples: int = 16
) -> Labelled:
    """``samples`` paths a pixel. Raises ``PathTracerMissingError`` without mitsuba."""
    mi = _mitsuba()
    camera = random_camera(rng, params.size, tilt_rad=float(rng.uniform(0.02, 0.6)))
    table = Canvas(pool.sample(rng, params.size, torch.device("cpu")).contiguous())
    if rng.random() < params.clutter:
        paint_clutter(table, rng, params.style)
    cables = []
    if rng.random() >= params.empty_share:
        layout = random_layout(rng, params.size, params.width_share, params.max_cables)
        cables = random_cables(rng, layout, table.rgb)
    paths, scale = _in_meters(cables, camera, params.size), _meters_a_pixel(camera)
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": 6},
            "sensor": _sensor(mi, camera, params.size),
            "table": _table(mi, rng, table, camera),
            **_lights(mi, rng, pool),
            **{
                f"cable{k:03d}": _tube(mi, c, path, scale)
                for k, (c, path) in enumerate(zip(cables, paths, strict=True))
            },
        }
    )
    linear = np.asarray(mi.render(scene, spp=samples, seed=int(rng.integers(1 << 31))))[:, :, :3]
    rgb = torch.as_tensor(_exposed(linear)).permute(2, 0, 1).contiguous()
    ids, depth = _ids_and_depth(mi, scene, camera, params.size)
    return _labelled(photograph(rgb, rng), ids, depth, cables, paths, camera)


def _mitsuba() -> Any:
    try:
        import mitsuba as mi
    except ImportError as missing:
        raise PathTracerMissingError(
            "the path-traced renderer needs mitsuba: pip install -r requirements/photoreal.in"
        ) from missing
    mi.set_variant(
        "scalar_rgb"
    )  # needs no LLVM and compiles nothing: fastest for many small different scenes
    return mi


def _in_meters(cables: Sequence[Cable], camera: Camera, size: tuple[int, int]) -> list[FloatArray]:
    """Centerlines (m, 3) in the world: the table is what the untilted camera would see of it."""
    halves = [float(c.half_width.max()) for c in cables]
    plan = stack([c.curve for c in cables], halves)
    scale = _meters_a_pixel(camera)
    middle = np.array([(size[1] - 1) / 2, (size[0] - 1) / 2])
    flats = [(c.curve[:, :2] - middle) * (scale, -scale) for c in cables]
    heights = resting_heights(plan, halves)
    return [
        np.column_stack([xy, z * scale]).astype(np.float32)
        for xy, z in zip(flats, heights, strict=True)
    ]


def _meters_a_pixel(camera: Camera) -> float:
    return float(camera.T_camera_world[2, 3] / camera.K[0, 0])


def _sensor(mi: Any, camera: Camera, size: tuple[int, int], *, labels: bool = False) -> Any:
    """For ``labels`` one sample at the center of every pixel; else filtered over the pixel."""
    height, width = size
    to_world = np.linalg.inv(camera.T_camera_world.astype(np.float64)) @ np.diag(
        [-1.0, -1.0, 1.0, 1.0]
    )
    sampler = (
        {"type": "stratified", "jitter": False, "sample_count": 1}
        if labels
        else {"type": "independent"}
    )
    return {
        "type": "perspective",
        "fov": float(np.degrees(2 * np.arctan(width / 2 / camera.K[0, 0]))),
        "fov_axis": "x",
        "near_clip": 1e-3,
        "to_world": mi.ScalarTransform4f(to_world),
        "sampler": sampler,
        "film": {
            "type": "hdrfilm",
            "width": width,
            "height": height,
            "component_format": "float32",
            "rfilter": {"type": "box" if labels else "gaussian"},
        },
    }


def _table(mi: Any, rng: np.random.Generator, canvas: Canvas, camera: Camera) -> dict[str, Any]:
    """A rectangle with the canvas as its texture, matt or a little glossy."""
    scale = _meters_a_pixel(camera)
    half = np.array([canvas.width, canvas.height]) * scale / 2 * _TABLE
    picture = canvas.rgb.permute(1, 2, 0).clamp(0, 1).numpy() ** _GAMMA
    texture = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(picture, np.float32)),
        "raw": True,
        "wrap_mode": "mirror",
        # The picture fills the middle of the table: texture coordinates run over an odd number of
        # mirrored copies.
        "to_uv": mi.ScalarTransform4f()
        .translate([(1 - _TABLE) / 2, (1 - _TABLE) / 2, 0])
        .scale([_TABLE, _TABLE, 1]),
    }
    glossy = rng.random() < 0.3
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f().scale([half[0], half[1], 1]),
        "bsdf": _plastic(texture, float(rng.uniform(0.1, 0.4)))
        if glossy
        else {"type": "diffuse", "reflectance": texture},
    }


def _lights(mi: Any, rng: np.random.Generator, pool: TexturePool) -> dict[str, Any]:
    """A lamp from small and hard to large and soft, and surroundings that glossy surfaces
    mirror."""
    strength = float(rng.uniform(0.0, 1.0))
    azimuth, tilt, away = rng.uniform(-np.pi, np.pi), rng.uniform(0.1, 1.1), 2.0
    origin = [
        away * np.sin(tilt) * np.cos(azimuth),
        away * np.sin(tilt) * np.sin(azimuth),
        away * np.cos(tilt),
    ]
    size = float(np.exp(rng.uniform(np.log(0.03), np.log(1.0))))
    around = pool.sample(rng, (64, 128), torch.device("cpu")).permute(1, 2, 0).numpy() ** _GAMMA
    around = around / max(float(around.mean()), 1e-3)
    radiance = 3.0 * strength * away**2 / (4 * size**2) * rng.uniform(0.9, 1.1, 3)
    return {
        "around": {
            "type": "envmap",
            "bitmap": mi.Bitmap(np.ascontiguousarray(around, np.float32)),
            "scale": 1.05 - strength,
            "to_world": mi.ScalarTransform4f().rotate([1, 0, 0], 90),
        },
        "lamp": {
            "type": "rectangle",
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance.tolist()}},
            "to_world": mi.ScalarTransform4f()
            .look_at(origin, [0, 0, 0], [0, 0.1, 1])
            .scale([size, size, 1]),
        },
    }


def _tube(mi: Any, cable: Cable, path: FloatArray, scale: float) -> Any:
    """A mesh with the cable's pattern wrapped around it; ``scale`` m a pixel."""
    picked = np.unique(np.r_[0 : len(path) : _THINNED, len(path) - 1])
    tube = sweep(path[picked], cable.half_width[picked] * scale)
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict(_insulation(mi, cable.look, 0.7 * len(path)))
    mesh = mi.Mesh("tube", len(tube.vertices), len(tube.faces), properties, True, True)
    values = mi.traverse(mesh)
    values["vertex_positions"], values["vertex_normals"] = (
        tube.vertices.ravel(),
        tube.normals.ravel(),
    )
    values["vertex_texcoords"], values["faces"] = tube.uv.ravel(), tube.faces.ravel()
    values.update()
    return mesh


def _insulation(mi: Any, look: Look, length_px: float) -> dict[str, Any]:
    picture = wrapped_texture(look, length_px) ** _GAMMA
    texture = {
        "type": "bitmap",
        "bitmap": mi.Bitmap(np.ascontiguousarray(picture, np.float32)),
        "raw": True,
    }
    surface = (
        _plastic(texture, float(np.clip(look.shininess**-0.6, 0.03, 0.4)))
        if look.gloss > 0
        else {"type": "diffuse", "reflectance": texture}
    )
    surface = {"type": "twosided", "bsdf": surface}
    if look.opacity < 1:
        return {"type": "mask", "opacity": 0.5 + 0.5 * look.opacity, "bsdf": surface}
    return surface


def _plastic(texture: dict[str, Any], roughness: float) -> dict[str, Any]:
    return {
        "type": "roughplastic",
        "diffuse_reflectance": texture,
        "alpha": roughness,
        "nonlinear": True,
    }


def _exposed(linear: NDArray[np.floating]) -> FloatArray:
    """Linear light to the 0 to 1 of a picture whose 90 % brightest pixel is light, not burnt
    out."""
    gain = 0.7 / max(float(np.quantile(linear.mean(2), 0.9)), 1e-4)
    return np.clip(linear * min(gain, 4.0), 0, 1).astype(np.float32) ** np.float32(1 / _GAMMA)


def _ids_and_depth(
    mi: Any, scene: Any, camera: Camera, size: tuple[int, int]
) -> tuple[NDArray[np.int16], FloatArray]:
    """(H, W) ids, and (H, W) distance m from the camera along the ray through each pixel's
    center."""
    integrator = mi.load_dict({"type": "aov", "aovs": "depth:depth,shape:shape_index"})
    sensor = mi.load_dict(_sensor(mi, camera, size, labels=True))
    planes = np.asarray(mi.render(scene, sensor=sensor, integrator=integrator, spp=1))
    numbers = [int(s.id()[5:]) + 1 if s.id().startswith("cable") else 0 for s in scene.shapes()]
    owner = np.array(
        [0, *numbers], np.int16
    )  # shapes are counted from 1; 0 where a ray meets nothing
    return owner[np.rint(planes[:, :, -1]).astype(int)], planes[:, :, -2]


def _labelled(
    rgb: torch.Tensor,
    ids: NDArray[np.int16],
    depth: FloatArray,
    cables: Sequence[Cable],
    paths: Sequence[FloatArray],
    camera: Camera,
) -> Labelled:
    """Everything seen from the camera: heights grow towards it, in table pixels."""
    scale = _meters_a_pixel(camera)
    eye = np.linalg.inv(camera.T_camera_world.astype(np.float64))[:3, 3]
    away = [np.linalg.norm(path - eye, axis=1) for path in paths]
    farthest = max((float(a.max()) for a in away), default=0.0)
    curves = [
        np.column_stack([camera.project(path), (farthest - a) / scale]).astype(np.float32)
        for path, a in zip(paths, away, strict=True)
    ]
    halves = [scale * float(np.median(c.half_width)) for c in cables]
    seen = [
        _seen(k + 1, c, a, h, ids, depth)
        for k, (c, a, h) in enumerate(zip(curves, away, halves, strict=True))
    ]
    widths = [
        2 * float(np.median(c.half_width)) * float(np.median(camera.T_camera_world[2, 3] / a))
        for c, a in zip(cables, away, strict=True)
    ]
    return Labelled(
        rgb=rgb,
        ids=torch.as_tensor(ids),
        centerlines=tuple(curves),
        widths_px=tuple(widths),
        visible=tuple(seen),
        crossings=tuple(_crossings(curves, ids)),
        camera=camera,
    )


def _seen(
    number: int,
    curve: FloatArray,
    away: NDArray,
    half: float,
    ids: NDArray[np.int16],
    depth: FloatArray,
) -> NDArray[np.bool_]:
    """(m,) samples in the picture where the ray meets this strand, not another or itself
    elsewhere."""
    height, width = ids.shape
    xy = np.rint(curve[:, :2]).astype(int)
    inside = np.logical_and(xy >= 0, xy < (width, height)).all(axis=1)
    row, column = np.clip(xy[:, 1], 0, height - 1), np.clip(xy[:, 0], 0, width - 1)
    return np.asarray(
        inside & (ids[row, column] == number) & (np.abs(depth[row, column] - away) < 2.5 * half)
    )


def _crossings(curves: Sequence[FloatArray], ids: NDArray[np.int16]) -> Iterator[Crossing]:
    """In the picture; the strand nearer to the camera is on top."""
    height, width = ids.shape
    for m in intersections(curves):
        x, y = round(m.xy[0]), round(m.xy[1])
        if not (0 <= x < width and 0 <= y < height):
            continue
        passes = (m.first, m.first_sample), (m.second, m.second_sample)
        under, over = sorted(passes, key=lambda at: float(curves[at[0]][at[1], 2]))
        seen = bool(ids[y, x] == over[0] + 1)
        yield Crossing(m.xy, over[0] + 1, under[0] + 1, over[1], under[1], seen)
