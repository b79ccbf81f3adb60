"""Where the strands of a picture have moved the cables that were expected near them.

Strategy: two cables upon one another are one strand in a picture. So a cable is laid on whatever
strand runs its way near each of its nodes, whoever that strand is thought to be: its nodes move by
a sum of a few cosines along it, with stiffness and without stretch, as in
:mod:`models.tracking.sliding`; nodes whose strand disagrees with the rest count less in every
round. All cables are laid at once: each node has looked for its nearest samples once, C cables of
NODES nodes with K samples near each.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray
from models.tracking.ownership import Samples, directions
from models.tracking.sliding import MODES, precision, stretch, waves
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
_NEAREST = 12
"""Samples that a node looks at."""
_WAVES = waves(np.linspace(0.0, 1.0, NODES))


class _Cables(NamedTuple):
    """C cables that can be laid: ``xy`` (C, NODES, 2) where they are predicted, ``known`` (C,
    NODES) of which nodes that is known; ``width_px`` (C,), ``reach_px`` (C,) how far along itself a
    node looks; ``prior`` (C, 2 MODES, 2 MODES) what holds the factors of the cosines."""

    xy: FloatArray
    known: BoolArray
    width_px: FloatArray
    reach_px: FloatArray
    prior: FloatArray


class _Near(NamedTuple):
    """The samples near each node, (C, NODES, K) each: where they are, in which direction the strand
    runs there, and its ``trust``."""

    x: FloatArray
    y: FloatArray
    dx: FloatArray
    dy: FloatArray
    trust: FloatArray


class _Strands(NamedTuple):
    """Of each node the nearest strand that runs its way: ``off`` (C, NODES) px to it along its
    ``normal`` (C, NODES, 2); whether it was ``found``; ``trust`` (C, NODES) as of the samples."""

    off: FloatArray
    normal: FloatArray
    found: BoolArray
    trust: FloatArray


def registered(
    cables: Sequence[TrackedCable], predicted: Sequence[FloatArray], samples: Samples | None
) -> list[FloatArray]:
    """(NODES, 2) of every cable laid on the strands near where it is ``predicted`` (NODES, 2)."""
    out = list(predicted)
    if samples is None:
        return out
    laid = [
        i for i, cable in enumerate(cables) if not cable.missed and _known(cable).sum() >= _FRESH
    ]
    for fresh in (True, False):
        group = [i for i in laid if (cables[i].met < _FRESH) == fresh]
        gates = (_AT_FIRST_WIDTHS, *_GATES_WIDTHS) if fresh else _GATES_WIDTHS
        if group:
            placed = _registered(
                _gathered([cables[i] for i in group], [predicted[i] for i in group]), samples, gates
            )
            for i, xy in zip(group, placed, strict=True):
                out[i] = xy
    return out


def _known(cable: TrackedCable) -> BoolArray:
    return np.asarray(cable.spread <= _KNOWN_WIDTHS * cable.width_px)


def _gathered(cables: Sequence[TrackedCable], predicted: Sequence[FloatArray]) -> _Cables:
    xy = np.stack(predicted)
    width = np.array([cable.width_px for cable in cables])
    lengths = np.array([cable.length_px for cable in cables])
    rows = stretch(directions(xy))
    prior = rows.transpose(0, 2, 1) @ rows
    diagonal = np.arange(prior.shape[-1])
    prior[:, diagonal, diagonal] += [precision(cable) for cable in cables]
    known = np.stack([_known(cable) for cable in cables])
    return _Cables(xy, known, width, np.maximum(lengths / (NODES - 1), width), prior)


def _registered(cables: _Cables, samples: Samples, gates: Sequence[float]) -> FloatArray:
    """(C, NODES, 2); a cable that finds too few strands stays where it is predicted."""
    near = _near(cables.xy, samples)
    xy, factors = cables.xy, np.zeros((len(cables.xy), 2 * MODES, 1))
    enough = np.ones(len(xy), bool)
    for gate in gates:
        strands = _to_strands(xy, near, gate, cables)
        use = strands.found & cables.known
        enough &= use.sum(1) >= _FRESH
        matrix = np.concatenate(
            [_WAVES * strands.normal[..., :1], _WAVES * strands.normal[..., 1:]], axis=2
        )
        far = strands.off / (_OFF_WIDTHS * cables.width_px)[:, None]
        weight = use * np.where(strands.trust >= 1, 1.0, _OF_TANGLED) / (1.0 + far**2)
        wanted = strands.off[..., None] + matrix @ factors
        weighted = (matrix * weight[..., None]).transpose(0, 2, 1)
        factors = np.linalg.solve(weighted @ matrix + cables.prior, weighted @ wanted)
        xy = cables.xy + np.concatenate(
            [_WAVES @ factors[:, :MODES], _WAVES @ factors[:, MODES:]], axis=2
        )
    strands = _to_strands(xy, near, gates[-1], cables)
    alone = strands.found & cables.known & (strands.trust >= 1)
    xy = xy + np.where(alone, strands.off, 0.0)[..., None] * strands.normal
    return np.where(enough[:, None, None], xy, cables.xy)


def _near(xy: FloatArray, samples: Samples) -> _Near:
    count = min(_NEAREST, len(samples.xy))
    _, index = samples.tree.query(xy.reshape(-1, 2), k=np.arange(1, count + 1))
    index = index.reshape(*xy.shape[:2], count)
    return _Near(
        *(values[index] for values in (*samples.xy.T, *samples.direction.T, samples.trust))
    )


def _to_strands(xy: FloatArray, near: _Near, gate_widths: float, cables: _Cables) -> _Strands:
    tangent = directions(xy)
    tx, ty = tangent[..., :1], tangent[..., 1:]
    away_x, away_y = near.x - xy[..., :1], near.y - xy[..., 1:]
    along = np.abs(away_x * tx + away_y * ty)
    across = np.abs(away_y * tx - away_x * ty)
    turned = np.abs(near.dy * tx - near.dx * ty)
    gate = gate_widths * cables.width_px[:, None, None]
    meets = (along < cables.reach_px[:, None, None]) & (across < gate) & (turned < _TURNED)
    cost = np.where(meets, across + 0.5 * along, np.inf)
    count = cost.shape[2]
    best = cost.argmin(2) + count * np.arange(cost.size // count).reshape(cost.shape[:2])
    x, y, dx, dy, least, trust = (
        values.reshape(-1)[best] for values in (away_x, away_y, near.dx, near.dy, cost, near.trust)
    )
    return _Strands(y * dx - x * dy, np.stack([-dy, dx], axis=2), np.isfinite(least), trust)
