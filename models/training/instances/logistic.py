"""Logistic regression: how strongly each measurement speaks for an answer to be right."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import minimize

from models.geometry.arrays import BoolArray, FloatArray

Bounds = Sequence[tuple[float | None, float | None]]


def fit_logistic(
    features: FloatArray, right: BoolArray, shrinkage: FloatArray, bounds: Bounds | None = None
) -> FloatArray:
    """``(f,)`` weights of ``(n, f)`` features, so that 1 / (1 + exp(-features @ weights)) is the
    chance to be right.

    ``shrinkage`` ``(f,)``: the price of each weight's square; ``bounds`` of each weight.
    """
    sign = np.where(right, 1.0, -1.0)

    def loss(weights: FloatArray) -> tuple[float, FloatArray]:
        margin = sign * (features @ weights)
        slope = -sign / (1 + np.exp(np.clip(margin, -50, 50)))
        value = np.logaddexp(0, -margin).mean() + float(shrinkage @ weights**2)
        return float(value), features.T @ slope / len(right) + 2 * shrinkage * weights

    start = np.zeros(features.shape[1])
    return np.asarray(minimize(loss, start, jac=True, bounds=bounds, method="L-BFGS-B").x)
