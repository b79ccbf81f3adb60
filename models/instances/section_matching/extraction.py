"""Our own method: sections of the skeleton, matched jointly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Never

import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from models.instances.assembly import assemble
from models.instances.scene import Scene
from models.instances.section_matching.links import SHARED, Links, candidate_links, costs_of
from models.instances.working_size import at_working_size
from models.strands.cleaning import clean
from models.strands.pairing import match
from models.strands.pixel_graph import FREE, trace
from models.strands.sections import Sections, sections_of
from models.strands.stopwatch import Stopwatch
from models.strands.walks import Joint, strands_of

_BORDER_STOP = -2.0
"""Log odds against a DLO that ends at the border: it leaves the picture."""

_AT_KINK = 4.0
"""So many times more it costs to stop where nothing but the two sides of a kink meets, unless the
border is near: DLOs that leave the picture side by side meet, too."""
_FAR_RADII = 12.0
"""The border is not near; and a section of so many radii from a crossing to a free end is no
stub."""


@dataclass(frozen=True)
class SectionMatchingParams:
    """``hole_widths``: holes up to this squared, in typical widths, are filled; ``gap_widths``:
    longest gap to bridge; ``stop_cost``: log odds against a DLO that ends at a crossing."""

    hole_widths: float = 0.7
    gap_widths: float = 20.0
    stop_cost: float = 3.0


def extract(
    mask: BoolArray,
    image: ByteArray | None = None,
    params: SectionMatchingParams | None = None,
    networks: Sequence[Never] = (),
) -> Scene:
    """The DLOs of a foreground mask.

    ``mask``: ``(H, W)``. ``image``: ``(H, W, 3)`` RGB or None. It takes no ``networks``.
    """
    settings = params or SectionMatchingParams()
    return at_working_size(mask, image, lambda m, i: _extract(m, i, settings))


def _extract(mask: BoolArray, image: ByteArray | None, params: SectionMatchingParams) -> Scene:
    watch = Stopwatch()
    with watch.step("cleaning"):
        foreground = clean(mask, params.hole_widths)
        distances = foreground.distances
    with watch.step("skeleton"):
        graph = trace(foreground)
    with watch.step("matching"):
        sections = sections_of(graph, distances, image)
        links = candidate_links(sections, foreground.mask, image, params.gap_widths)
        costs = costs_of(links)
        partner = match(
            len(sections.node), links.pairs, costs, _stops(sections, params.stop_cost), links.via
        )
        chains = strands_of(sections, partner, _joints(links, costs, partner))
    return assemble(
        chains,
        foreground.mask,
        distances,
        image,
        watch,
        method="section_matching",
        follow_edges=True,
    )


def _joints(links: Links, costs: FloatArray, partner: IntArray) -> dict[tuple[int, int], Joint]:
    """The links taken: the section along which two ends go on together with another DLO, and the
    doubt."""
    taken = np.flatnonzero(partner[links.pairs[:, 0]] == links.pairs[:, 1])
    doubts = np.logaddexp(0.0, costs[taken])
    shared = np.where(links.kind[taken] >= SHARED, links.via[taken], -1)
    rows = zip(links.pairs[taken].tolist(), shared.tolist(), doubts.tolist(), strict=True)
    return {(a, b): Joint(via, doubt) for (a, b), via, doubt in rows}


def _stops(sections: Sections, at_crossing: float) -> FloatArray:
    """``(E,)`` what it costs an end to stop: nothing where it is free, less than nothing at the
    border; at a crossing the less the shorter a section is that ends freely on its other side: most
    such stubs are no DLO's. Where only two ends meet, a DLO has a kink: both stop only if all
    speaks against it."""
    other = np.arange(len(sections.node)) ^ 1
    stub = (sections.node[other] == FREE) & ~sections.at_border[other]
    size = np.repeat(sections.length / (_FAR_RADII * sections.radius), 2)
    far = sections.to_edge > _FAR_RADII * sections.end_radius
    meeting = np.bincount(sections.node[sections.node >= 0], minlength=1)[sections.node]
    crossing = at_crossing * np.where(
        (meeting == 2) & far, _AT_KINK, np.where(stub, np.minimum(size, 1.0), 1.0)
    )
    out: FloatArray = np.where(
        sections.node >= 0, crossing, np.where(sections.at_border, _BORDER_STOP, 0.0)
    )
    return out
