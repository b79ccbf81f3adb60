"""The point nearest to several rays (thesis section 4.5.2, eq. 4.1)."""

from __future__ import annotations

import numpy as np

from models.geometry.arrays import FloatArray


def nearest_to_rays(
    centers: FloatArray, directions: FloatArray, weights: FloatArray | None = None
) -> FloatArray:
    """(n, 3) points with the least sum of squared distances to their k rays.

    ``centers`` (k, 3), ``directions`` (k, n, 3) of any length, ``weights`` (k, n), 0 for a ray to
    pass over. ``p = (sum V_i)^-1 (sum V_i t_i)`` with ``V_i = I - v_i v_i^T``; NaN where the rays
    are parallel.
    """
    unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    share = np.ones(unit.shape[:2]) if weights is None else weights
    across = np.eye(3) - unit[..., :, None] * unit[..., None, :]
    matrix = np.einsum("kn,knij->nij", share, across)
    right = np.einsum("kn,knij,kj->ni", share, across, centers)
    flat = np.abs(np.linalg.det(matrix)) < 1e-12 * np.maximum(share.sum(0), 1e-12) ** 3
    matrix[flat] = np.eye(3)
    points: FloatArray = np.linalg.solve(matrix, right[..., None])[..., 0]
    points[flat] = np.nan
    return points


def depth_on_ray(
    center: FloatArray,
    directions: FloatArray,
    other_center: FloatArray,
    other_directions: FloatArray,
) -> FloatArray:
    """(n,) how far along the first rays (in units of ``directions``) they come nearest to the
    second ones; infinite where the two are parallel. Centers (3,), directions (n, 3)."""
    between = other_center - center
    aa = np.einsum("ni,ni->n", directions, directions)
    bb = np.einsum("ni,ni->n", other_directions, other_directions)
    ab = np.einsum("ni,ni->n", directions, other_directions)
    determinant = aa * bb - ab**2
    parallel = determinant < 1e-14 * aa * bb
    along = (directions @ between) * bb - (other_directions @ between) * ab
    depth: FloatArray = np.where(parallel, np.inf, along / np.where(parallel, 1.0, determinant))
    return depth
