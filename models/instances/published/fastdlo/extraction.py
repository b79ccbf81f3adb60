"""The steps of FASTDLO in order (thesis Fig. 3.7)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from models.instances.assembly import assemble
from models.instances.published.fastdlo.similarity import (
    FEATURES,
    SimilarityNetwork,
    features,
    probabilities,
)
from models.instances.scene import Scene
from models.instances.working_size import at_working_size
from models.strands.foreground import Foreground
from models.strands.pairing import greedy
from models.strands.pixel_graph import trace
from models.strands.sections import Sections, pairs_at_junctions, sections_of
from models.strands.seen import SHARED_RADII
from models.strands.stopwatch import Stopwatch
from models.strands.walks import strands_of


@dataclass(frozen=True)
class FastDloParams:
    """``min_probability``: t_c of Algorithm 3, the weakest connection made (the thesis names no
    number)."""

    min_probability: float = 1e-4


def extract(
    mask: BoolArray,
    image: ByteArray | None = None,
    params: FastDloParams | None = None,
    networks: Sequence[SimilarityNetwork] = (),
) -> Scene:
    """The DLOs of a foreground mask.

    ``mask``: ``(H, W)``. ``image``: ``(H, W, 3)`` RGB or None (then width and direction decide).
    ``networks``: that of 3.4.4; without it, connections follow the features' plain distance.

    Any mask is allowed, and the work is bounded: beyond 4 megapixels the mask is reduced, at most
    3 000 segments and 255 instances remain. Raises ``ValueError`` when the image is of another size
    than the mask.
    """
    settings = params or FastDloParams()
    return at_working_size(
        mask, image, lambda m, i: _extract(m, i, settings, networks[0] if networks else None)
    )


def _extract(
    mask: BoolArray,
    image: ByteArray | None,
    params: FastDloParams,
    similarity: SimilarityNetwork | None,
) -> Scene:
    watch = Stopwatch()
    with watch.step("skeleton"):
        foreground = Foreground.of(mask)
        sections = sections_of(trace(foreground), foreground.distances, image, SHARED_RADII)
    with watch.step("network"):
        pairs, probability = process_intersections(sections, similarity)
    with watch.step("merging"):
        # Algorithm 3: best pairs first, each endpoint once.
        partner = greedy(len(sections.node), pairs, probability, params.min_probability)
        chains = strands_of(sections, partner, {})
    return assemble(chains, mask, foreground.distances, image, watch, method="fastdlo")


def process_intersections(
    sections: Sections, similarity: SimilarityNetwork | None
) -> tuple[IntArray, FloatArray]:
    """Algorithm 2: ``(m, 2)`` pairs of endpoints of the same intersection and their connection
    probability.

    Features are relative to the endpoints of the same intersection; all go through the network in
    one batch. The two ends of one segment are no pair: a loop is a segment with both ends at one
    crossing, and each of them goes on elsewhere.
    """
    pairs = pairs_at_junctions(sections)
    pairs = pairs[pairs[:, 0] >> 1 != pairs[:, 1] >> 1]
    ends = np.unique(pairs)
    if not len(ends):
        return pairs, np.zeros(0)
    rows = np.zeros((len(ends), FEATURES), np.float32)
    nodes = sections.node[ends]
    for node in np.unique(nodes):
        here = nodes == node
        of = ends[here]
        rows[here] = features(sections.color[of], sections.end_radius[of], sections.outward[of])
    embedded = rows if similarity is None else similarity(rows)
    place = np.searchsorted(ends, pairs)
    apart = embedded[place[:, 0]].astype(np.float64) - embedded[place[:, 1]]
    return pairs, probabilities(apart)
