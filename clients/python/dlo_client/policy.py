"""An answer as arrays of a fixed shape, for a policy or a learner that takes tensors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dlo_client.contracts import (
    Curve3D,
    InstancesResult,
    MergeCurvesResult,
    ReconstructResult,
    TopologyResult,
)
from dlo_client.errors import InvalidArgument
from dlo_client.polylines import arc_lengths

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    FloatArray = NDArray[np.float64]

_PLACES = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
"""Where an entry of a covariance stands in a contract's six numbers."""


@dataclass(frozen=True, repr=False)
class PolicyState:
    """C cables of N nodes in D dimensions: pixels (D = 2) or meters in the world (D = 3).

    ``ids`` (C,) int, 0 where there is no cable; ``points`` (C, N, D), equally far apart;
    ``covariance`` (C, N, D, D), NaN where the answer states none, as in pixels; ``scores`` (C,);
    ``there`` (C,) bool.
    """

    ids: NDArray[np.int64]
    points: FloatArray
    covariance: FloatArray
    scores: FloatArray
    there: NDArray[np.bool_]

    def __repr__(self) -> str:
        return f"PolicyState({int(self.there.sum())} of {len(self.ids)} cables, points {self.points.shape})"


def state(result: Any, nodes: int = 32, cables: int | None = None) -> PolicyState:
    """The cables of a result, each as ``nodes`` points; ``cables``: so many rows, the best ones
    first, padded with zeros. Default: as many as there are. Needs NumPy. Raises InvalidArgument for
    a result without cables."""
    import numpy as np

    if nodes < 2 or (cables is not None and cables < 1):
        raise InvalidArgument("nodes", "a state has two nodes or more, and one cable or more")
    found = _lines(result)
    found.sort(key=lambda line: -line[1])
    rows = len(found) if cables is None else cables
    size = (
        len(found[0][2][0])
        if found
        else 2
        if isinstance(result, InstancesResult | TopologyResult)
        else 3
    )
    ids, scores = np.zeros(rows, np.int64), np.zeros(rows)
    points, covariance = np.zeros((rows, nodes, size)), np.full((rows, nodes, size, size), np.nan)
    for row, (number, score, line, spread) in enumerate(found[:rows]):
        ids[row], scores[row] = number, score
        points[row], share = _resampled(np.array(line, float), nodes)
        if spread:
            full = np.array(spread)[:, _PLACES].reshape(len(spread), 3, 3)
            at = np.linspace(0, 1, len(full))
            flat = [np.interp(share, at, column) for column in full.reshape(len(full), 9).T]
            covariance[row] = np.stack(flat, axis=1).reshape(nodes, 3, 3)
    return PolicyState(ids, points, covariance, scores, np.arange(rows) < len(found))


_Line = tuple[int, float, Sequence[Sequence[float]], Sequence[Sequence[float]]]


def _lines(result: Any) -> list[_Line]:
    """Id, score, points and covariances of every cable."""
    match result:
        case InstancesResult():
            return [(i.id, i.score, i.centerline_xy, ()) for i in result.instances]
        case TopologyResult():
            return [(s.id, s.score, s.points_xy, ()) for s in result.sections]
        case ReconstructResult():
            curves = [result.curve, *(other.curve for other in result.others)]
            return [_line(number, curve) for number, curve in enumerate(curves, start=1)]
        case MergeCurvesResult() | Curve3D():
            return [_line(1, result if isinstance(result, Curve3D) else result.curve)]
    raise InvalidArgument("result", f"{type(result).__name__} has no cables")


def _line(number: int, curve: Curve3D) -> _Line:
    return number, 1.0, curve.points_m, curve.covariance_m2


def _resampled(line: FloatArray, nodes: int) -> tuple[FloatArray, FloatArray]:
    """(nodes, D) at equal arc length, and where they are as shares of the indices."""
    import numpy as np

    along = arc_lengths(line)
    at = np.linspace(0, along[-1], nodes)
    points = np.stack([np.interp(at, along, column) for column in line.T], axis=1)
    return points, np.interp(at, along, np.linspace(0, 1, len(line)))
