"""Labelled patches for the orientation network: random strands are drawn, their tangents are
known."""

from __future__ import annotations

import cv2
import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from models.geometry.sampling import farthest_points, local_maxima
from models.instances.published.rt_dlo.orientation import PATCH_SIZE, read_patches
from models.strands.foreground import distance_map

_SIDE = 224
_SAMPLING_RATIO = 0.3


def make_patches(count: int, rng: np.random.Generator) -> tuple[Float32Array, FloatArray]:
    """``(count, s, s)`` patches and their true angles ``(count,)`` in radians."""
    patches, angles, made = [], [], 0
    while made < count:
        scene_patches, scene_angles = _scene_patches(rng)
        patches.append(scene_patches)
        angles.append(scene_angles)
        made += len(scene_angles)
    return np.concatenate(patches)[:count], np.concatenate(angles)[:count]


def _scene_patches(rng: np.random.Generator) -> tuple[Float32Array, FloatArray]:
    """Patches of one scene at the places RT-DLO would look at; the label is the nearest strand's
    tangent."""
    mask, curves = _scene(rng)
    distances = distance_map(_worn(mask, rng))
    maxima = local_maxima(distances)
    if len(maxima) < 8:
        return np.zeros((0, PATCH_SIZE, PATCH_SIZE), np.float32), np.zeros(0)
    pixels = maxima[farthest_points(maxima, int(_SAMPLING_RATIO * len(maxima)))]
    radii = np.maximum(distances[pixels[:, 1], pixels[:, 0]].astype(np.float64) - 0.5, 0.5)
    xy = pixels.astype(np.float64)
    apart, nearest = cKDTree(np.concatenate(curves)).query(xy)
    on_strand = apart < np.maximum(2.0, 0.5 * radii)
    dx, dy = np.concatenate([np.gradient(curve, axis=0) for curve in curves])[nearest].T
    patches = read_patches(distances, xy, np.maximum(radii, np.median(radii)))
    return patches[on_strand], np.mod(np.arctan2(dy, dx), np.pi)[on_strand]


def _scene(rng: np.random.Generator) -> tuple[ByteArray, list[FloatArray]]:
    """A mask of one to five strands of about one width, and their center curves."""
    width = rng.uniform(2.5, 22)
    mask = np.zeros((_SIDE, _SIDE), np.uint8)
    curves = []
    for _ in range(rng.integers(1, 6)):
        curve = random_curve(rng)
        fixed = np.rint(curve * 16).astype(np.int32)
        cv2.polylines(
            mask, [fixed], False, 1, max(2, round(width * rng.uniform(0.7, 1.4))), shift=4
        )
        curves.append(curve)
    return mask, curves


def random_curve(rng: np.random.Generator) -> FloatArray:
    """``(300, 2)`` points of a smooth random curve; some leave the picture, some end in it."""
    start, heading = rng.uniform(-20, _SIDE + 20, 2), rng.uniform(0, 2 * np.pi)
    steps = rng.integers(4, 8)
    headings = heading + np.cumsum(rng.normal(0, rng.uniform(0.1, 0.7), steps))
    lengths = rng.uniform(25, 70, steps)
    moves = np.stack((np.cos(headings), np.sin(headings)), axis=1) * lengths[:, None]
    knots = np.concatenate((start[None], start + np.cumsum(moves, axis=0)))
    curve: FloatArray = make_interp_spline(np.linspace(0, 1, len(knots)), knots, k=3)(
        np.linspace(0, 1, 300)
    )
    return curve


def _worn(mask: ByteArray, rng: np.random.Generator) -> BoolArray:
    """The mask with the uneven outline and the holes that a segmentation network leaves."""
    soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), rng.uniform(0.6, 1.6))
    noise = cv2.GaussianBlur(
        rng.normal(size=mask.shape).astype(np.float32), (0, 0), rng.uniform(0.8, 3.0)
    )
    worn: BoolArray = soft + noise * (rng.uniform(0, 0.3) / max(float(noise.std()), 1e-6)) > 0.5
    for x, y in rng.integers(0, _SIDE, (rng.integers(0, 6), 2)):
        worn[y : y + rng.integers(1, 5), x : x + rng.integers(1, 5)] = False
    return worn
