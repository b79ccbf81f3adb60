"""Orientation of the DLO at each vertex (thesis 3.5.2): a patch of the distance transform gives an
angle.

A patch is measured in radii of the strand, not in pixels, so that one network serves every picture
size. Angles are in radians in [0, pi), from the x axis towards the y axis (down).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray

PATCH_SIZE = 15
CLASSES = 180
_REACH_RADII = 3.0
"""Half the side of a patch. Chosen so that the strand leaves the patch on both sides."""

OrientationNetwork = Callable[[Float32Array], Float32Array]
"""Patches ``(n, s, s)`` to scores ``(n, 180)``, one a degree; the network of thesis 3.5.2."""


def read_patches(distances: Float32Array, points_xy: FloatArray, radii: FloatArray) -> Float32Array:
    """``(n, s, s)`` patches around ``n`` points, ``s = PATCH_SIZE``: distances in radii, 0 outside
    the image.

    A pixel of the patch is ``3 radii / (s // 2)`` wide, but never less than a pixel of the picture.
    """
    half = PATCH_SIZE // 2
    padded = np.pad(distances, 1)
    steps = np.maximum(1.0, radii * (_REACH_RADII / half)).astype(np.float32)
    offsets = np.rint(steps[:, None] * np.arange(-half, half + 1, dtype=np.float32)).astype(
        np.int32
    )
    whole = np.rint(points_xy).astype(np.int32) + 1
    columns = np.clip(whole[:, :1] + offsets, 0, padded.shape[1] - 1)
    rows = np.clip(whole[:, 1:] + offsets, 0, padded.shape[0] - 1)
    patches: Float32Array = padded[rows[:, :, None], columns[:, None, :]]
    patches *= (1.0 / np.maximum(radii, 1.0)).astype(np.float32)[:, None, None]
    return patches


def angles_from_scores(scores: Float32Array) -> FloatArray:
    """``(n,)`` angles of the highest of ``(n, 180)`` class scores."""
    angles: FloatArray = np.argmax(scores, axis=1) * (np.pi / CLASSES)
    return angles


def principal_angles(patches: Float32Array) -> FloatArray:
    """``(n,)`` angles of the main axis through each patch's center, without a network.

    The second moments of the patch under a round Gaussian window, whose main axis is the direction.
    """
    moments = patches.reshape(len(patches), -1) @ _moment_basis()
    xx, xy, yy = moments.T.astype(np.float64)
    angles: FloatArray = np.mod(0.5 * np.arctan2(2 * xy, xx - yy), np.pi)
    return angles


def _moment_basis() -> Float32Array:
    """``(s * s, 3)``: x^2, xy and y^2 of every patch pixel, times the window."""
    half = PATCH_SIZE // 2
    y, x = np.mgrid[-half : half + 1, -half : half + 1].astype(np.float32).reshape(2, -1)
    window = np.exp(-(x**2 + y**2) / (2 * (0.5 * half) ** 2))
    basis: Float32Array = np.stack((x * x, x * y, y * y), axis=1) * window[:, None]
    return basis
