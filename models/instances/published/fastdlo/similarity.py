"""What FASTDLO's similarity network is asked, and what its answer means (thesis 3.4.4)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from models.geometry.arrays import Float32Array, FloatArray

FEATURES = 7
SimilarityNetwork = Callable[[Float32Array], Float32Array]
"""Features ``(n, 7)`` to embeddings ``(n, d)``."""


def features(colors: FloatArray, widths: FloatArray, outward: FloatArray) -> Float32Array:
    """``(n, 7)`` vectors of the endpoints of ONE intersection.

    ``colors``: ``(n, 3)`` RGB 0 to 255. ``widths``: ``(n,)``, taken relative to their mean, so that
    the scale of the picture does not matter. ``outward``: ``(n, 2)`` unit directions, by the cosine
    and sine of the doubled angle: two ends of one strand point opposite ways and have equal
    features. The last column is how much the colors differ in this intersection, the same for all
    of its endpoints: where strands look alike, directions have to tell.
    """
    shades = colors / 255.0
    cosine, sine = outward[:, 0], outward[:, 1]
    relative = (
        np.log(np.maximum(widths, 0.5) / max(float(widths.mean()), 0.5)) if len(widths) else widths
    )
    spread = np.full(
        (len(colors), 1),
        np.log(float(np.linalg.norm(shades.std(axis=0))) + 0.01) if len(colors) else 0.0,
    )
    columns = (
        shades,
        relative[:, None],
        (cosine**2 - sine**2)[:, None],
        (2 * cosine * sine)[:, None],
        spread,
    )
    return np.concatenate(columns, axis=1).astype(np.float32)


def probabilities(differences: FloatArray) -> FloatArray:
    """``(…,)`` connection probabilities ``exp(-d^2)`` of differences ``(…, d)`` between embeddings
    (Algorithm 2)."""
    out: FloatArray = np.exp(-np.einsum("...k,...k->...", differences, differences))
    return out
