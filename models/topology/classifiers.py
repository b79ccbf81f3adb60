"""Small networks that weigh evidence: is it a crossing, does a strand go on over a gap, is a short
strand a branch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from models.geometry.arrays import BoolArray, Float32Array, FloatArray, IntArray
from models.topology.graph import Graph
from models.topology.scene import Predictions

Classifier = Callable[[Float32Array], NDArray[np.floating]]
"""``(n, features)`` evidence to ``(n,)`` probabilities, or ``(n, readings)`` of which every row
sums to 1."""


@dataclass(frozen=True)
class Classifiers:
    """``crossing``: of :func:`sites.evidence`, the columns are :class:`sites.Reading`; ``bridge``:
    of :func:`bridges.proposals`; ``stub``: of :func:`stubs.candidates`, the probability that the
    strand is part of a DLO."""

    crossing: Classifier
    bridge: Classifier
    stub: Classifier


def probabilities_of(
    classifier: Classifier, rows: Sequence[Sequence[float] | FloatArray]
) -> FloatArray:
    """The classifier's probabilities for rows of evidence; ``(0,)`` for no rows."""
    if not rows:
        return np.zeros(0)
    return np.asarray(classifier(np.array(rows, np.float32)), np.float64)


Links = dict[tuple[int, int], float]
"""Probability by pair of nodes, the smaller first."""


def links_of(graph: Graph, predictions: Predictions, which: BoolArray) -> Links:
    """The probabilities of some of the graph's edges."""
    i, j = graph.edges[:, which]
    return dict(
        zip(
            zip(i.tolist(), j.tolist(), strict=True), predictions.links[which].tolist(), strict=True
        )
    )


def chain_links(chain: IntArray, links: Links) -> list[float]:
    """The probabilities of the links along a chain of nodes."""
    pairs = zip(
        np.minimum(chain[:-1], chain[1:]).tolist(),
        np.maximum(chain[:-1], chain[1:]).tolist(),
        strict=True,
    )
    return [links.get(p, 0.0) for p in pairs]
