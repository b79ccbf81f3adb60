"""Where the strands of a picture have moved a cable that was expected near them.

Strategy: two cables upon one another are one strand in a picture. So a cable is laid on whatever strand runs its way
near each of its nodes, whoever that strand is thought to be: its nodes move by a sum of a few cosines along it, with
stiffness and without stretch, as in :mod:`models.tracking.sliding`; nodes whose strand disagrees with the rest count
less in every round.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.tracking.ownership import Samples, directions
from models.tracking.sliding import precision, stretch, waves
from models.tracking.state import NODES, TrackedCable

_GATES_WIDTHS = 2.5, 1.5, 1.0
"""How far off across itself a strand may be, in every round."""
_AT_FIRST_WIDTHS = 4.0
"""The same while the velocity is not known."""
_TURNED = 0.5
"""Sine of the angle to the cable that a strand has at most."""
_OFF_WIDTHS = 0.4
"""A strand that is so far from where the cable as a whole moved to counts half."""
_KNOWN_WIDTHS = 1.5
"""A node that may be further off than this is not laid on a strand."""
_FRESH = 4
_OF_TANGLED = 0.1
"""Weight of a strand in a tangle: which of those there is the cable's is not known."""


def registered(cable: TrackedCable, predicted: FloatArray, samples: Samples | None) -> FloatArray:
    """(NODES, 2) the cable laid on the strands near ``predicted`` (NODES, 2)."""
    known = cable.spread <= _KNOWN_WIDTHS * cable.width_px
    if samples is None or cable.missed or known.sum() < _FRESH:
        return predicted
    gates = (_AT_FIRST_WIDTHS, *_GATES_WIDTHS) if cable.met < _FRESH else _GATES_WIDTHS
    near = _near(predicted[known], samples, gates[0] * cable.width_px + cable.length_px / NODES)
    rows = stretch(directions(predicted))
    prior = np.diag(precision(cable)) + rows.T @ rows
    basis = waves(np.linspace(0.0, 1.0, NODES))
    xy = predicted
    factors: FloatArray = np.zeros(prior.shape[0])
    for gate in gates:
        off, normal, found, trust = _to_strands(xy, near, gate * cable.width_px, cable)
        use = found & known
        if use.sum() < _FRESH:
            return predicted
        matrix = np.hstack([basis[use] * normal[use, :1], basis[use] * normal[use, 1:]])
        weight = np.where(trust[use] >= 1, 1.0, _OF_TANGLED) / (1.0 + (off[use] / (_OFF_WIDTHS * cable.width_px)) ** 2)
        wanted = off[use] + matrix @ factors
        weighted = (matrix * weight[:, None]).T
        factors = np.asarray(np.linalg.solve(weighted @ matrix + prior, weighted @ wanted))
        xy = predicted + basis @ factors.reshape(2, -1).T
    off, normal, found, trust = _to_strands(xy, near, _GATES_WIDTHS[-1] * cable.width_px, cable)
    return np.asarray(xy + np.where(found & known & (trust >= 1), off, 0.0)[:, None] * normal)


class _Near(NamedTuple):
    """Samples about a cable: ``xy``, ``direction`` (n, 2)."""

    xy: FloatArray
    direction: FloatArray
    trust: FloatArray


def _near(xy: FloatArray, samples: Samples, reach_px: float) -> _Near:
    inside = ((samples.xy > xy.min(0) - reach_px) & (samples.xy < xy.max(0) + reach_px)).all(1)
    return _Near(samples.xy[inside], samples.direction[inside], samples.trust[inside])


def _to_strands(
    xy: FloatArray, near: _Near, gate_px: float, cable: TrackedCable
) -> tuple[FloatArray, FloatArray, BoolArray, FloatArray]:
    """Px (NODES,) from each node to the nearest strand that runs its way, along the strand's normal (NODES, 2); and
    whether there is one within ``gate_px``."""
    if not len(near.xy):
        return np.zeros(NODES), np.zeros((NODES, 2)), np.zeros(NODES, bool), np.zeros(NODES)
    tangent = directions(xy)
    reach = max(cable.length_px / (NODES - 1), cable.width_px)
    # Products of matrices: |a - b| along t is a·t - b·t.
    along = tangent @ near.xy.T - (xy * tangent).sum(1)[:, None]
    normals = np.column_stack([-tangent[:, 1], tangent[:, 0]])
    across = np.abs(normals @ near.xy.T - (xy * normals).sum(1)[:, None])
    turned = np.abs(normals @ near.direction.T)
    along = np.abs(along)
    cost = np.where((along < reach) & (across < gate_px) & (turned < _TURNED), across + 0.5 * along, np.inf)
    best = cost.argmin(1)
    direction = near.direction[best]
    normal = np.column_stack([-direction[:, 1], direction[:, 0]])
    off = ((near.xy[best] - xy) * normal).sum(1)
    return off, normal, np.isfinite(cost[np.arange(NODES), best]), near.trust[best]
