"""Lengths along lines of points. NumPy is imported only when one is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def arc_lengths(line: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) from the first of n points (n, D) on, in their unit."""
    import numpy as np

    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
