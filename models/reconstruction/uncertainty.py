"""Whether a stated covariance holds: the test that the benchmark and the tests apply."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree
from scipy.stats import chi2

from models.geometry.arrays import BoolArray, FloatArray
from models.reconstruction.curves import Curve


def covers(curve: Curve, truth_m: FloatArray, level: float) -> BoolArray:
    """(n,) whether the true curve, (m, 3) dense points, passes through the ellipsoid of ``level`` around each point.

    The covariance has two dimensions, across the curve; the true curve's nearest point is compared there.
    """
    _, nearest = cKDTree(truth_m).query(curve.points_m)
    off = truth_m[nearest] - curve.points_m
    values, axes = np.linalg.eigh(curve.covariance_m2)
    along = np.einsum("nij,ni->nj", axes[:, :, 1:], off)
    squared = np.sum(along**2 / np.maximum(values[:, 1:], 1e-18), axis=1)
    inside: BoolArray = squared <= chi2.ppf(level, 2)
    return inside
