"""Which section ends may belong to one DLO, and how likely that is.

Symbols: E ends, m candidate links. A link's cost is minus the logarithm of its odds, from a
logistic model of a few measurements whose weights are fitted on scenes that the repository draws
(``train_links.py``).
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from statistics import median

import numpy as np
from scipy.spatial import cKDTree

from models.geometry.arrays import BoolArray, ByteArray, FloatArray, IntArray
from models.geometry.directions import angle_between, quarter_turned, unit
from models.geometry.polylines import bridge
from models.geometry.sampling import read_nearest
from models.strands.sections import NEAREST, Sections, pairs_at_junctions
from models.strands.seen import NOISE_LEVELS, SHARED_RADII

KINDS = ("junction", "gap", "shared", "absorbed")
JUNCTION, GAP, SHARED, ABSORBED = range(4)
"""Kinds of link: two ends at one crossing; over a gap; along a section that two DLOs share; that
section's own two ends: it is shared and no strand of its own."""
FEATURES = ("one", "turn", "sideways", "width", "chroma", "brightness", "gap", "length", "seen_gap")
"""``gap``: length off the mask where the picture does not show the DLO either; ``seen_gap``: where
it does."""
_BOWS_RADII = (-3.0, -1.5, 0.0, 1.5, 3.0)
"""Ways to bow in a gap that are looked at, in radii."""

WEIGHTS_FILE = Path(__file__).with_name("link_weights.toml")

_SHARED_THICK = 1.3
"""A section may be shared if it is short or this much thicker than what leads to it."""
_SAMPLES = 16
"""Of the way from one end to the other."""


@dataclass(frozen=True, eq=False)
class Links:
    """``pairs``: ``(m, 2)`` ends; ``kind``: ``(m,)``; ``features``: ``(m, 9)``; ``via``: ``(m,)``
    the shared section or -1."""

    pairs: IntArray
    kind: IntArray
    features: FloatArray
    via: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))


def candidate_links(
    sections: Sections, mask: BoolArray, image: ByteArray | None, gap_widths: float
) -> Links:
    """All links worth weighing."""
    crossing, gap = pairs_at_junctions(sections), _over_gaps(sections, gap_widths)
    shared, via = _along_shared(sections)
    absorbed = np.unique(via)
    pairs = np.concatenate(
        (crossing, gap, shared, np.stack((2 * absorbed, 2 * absorbed + 1), axis=1))
    )
    sizes = [len(crossing), len(gap), len(shared), len(absorbed)]
    kind = np.repeat([JUNCTION, GAP, SHARED, ABSORBED], sizes)
    through = np.concatenate((np.full(sizes[0] + sizes[1], -1), via, absorbed)).astype(np.int64)
    features = _measure(sections, pairs, kind, through, mask, image, 2 * gap_widths)
    return Links(pairs, kind, features, through)


@cache
def _weights() -> FloatArray:
    """``(4, 9)`` weights of each kind of link."""
    table = tomllib.loads(WEIGHTS_FILE.read_text())
    return np.array([[table[kind][feature] for feature in FEATURES] for kind in KINDS])


def costs_of(links: Links) -> FloatArray:
    """``(m,)`` minus the log odds that a link is right."""
    out: FloatArray = np.einsum("ij,ij->i", links.features, _weights()[links.kind])
    return out


def _over_gaps(sections: Sections, gap_widths: float) -> IntArray:
    """Pairs of near ends, at least one of them free, that face each other."""
    if len(sections) == 0:
        return np.zeros((0, 2), np.int64)
    free = np.flatnonzero((sections.node < 0) & ~np.repeat(sections.closed, 2))
    every = np.flatnonzero(~np.repeat(sections.closed, 2))
    if len(free) == 0:
        return np.zeros((0, 2), np.int64)
    reach = 2 * gap_widths * float(np.median(sections.radius))
    k = min(NEAREST, len(every))
    near = np.asarray(
        cKDTree(sections.tip[every]).query(sections.tip[free], k, distance_upper_bound=reach)[1]
    )
    a, b = np.repeat(free, k), np.append(every, -1)[near.reshape(-1)]
    proper = (b >= 0) & (a != b)
    keys = np.unique(np.minimum(a, b)[proper] * len(sections.node) + np.maximum(a, b)[proper])
    pairs = np.stack(np.divmod(keys, len(sections.node)), axis=1)
    link = sections.tip[pairs[:, 1]] - sections.tip[pairs[:, 0]]
    leaving = np.einsum("ij,ij->i", sections.outward[pairs[:, 0]], link)
    arriving = -np.einsum("ij,ij->i", sections.outward[pairs[:, 1]], link)
    return pairs[(leaving > 0) & (arriving > 0)]


def _along_shared(sections: Sections) -> tuple[IntArray, IntArray]:
    """Pairs of ends at the two nodes of a section that two DLOs may share, and that section."""
    nodes = sections.node.reshape(-1, 2)
    candidates = np.flatnonzero((nodes >= 0).all(axis=1) & (nodes[:, 0] != nodes[:, 1]))
    at: dict[int, list[int]] = {}
    for end in np.flatnonzero(sections.node >= 0).tolist():
        at.setdefault(int(sections.node[end]), []).append(end)
    pairs, via = [], []
    for section in candidates.tolist():
        here, there = ([e for e in at[int(n)] if e >> 1 != section] for n in nodes[section])
        if len(here) > NEAREST or len(there) > NEAREST or min(len(here), len(there)) < 2:
            continue
        leading = median(sections.end_radius[here + there].tolist())
        thick = sections.radius[section] > _SHARED_THICK * leading
        if thick or sections.length[section] <= SHARED_RADII * leading:
            found = [(min(a, b), max(a, b)) for a in here for b in there if a >> 1 != b >> 1]
            pairs += found
            via += [section] * len(found)
    return np.array(pairs, dtype=np.int64).reshape(-1, 2), np.array(via, dtype=np.int64)


def _measure(
    sections: Sections,
    pairs: IntArray,
    kind: IntArray,
    via: IntArray,
    mask: BoolArray,
    image: ByteArray | None,
    longest: float,
) -> FloatArray:
    """``(m, 9)`` the measurements of :data:`FEATURES`; lengths in radii, up to ``longest``, angles
    in radians, colors in 100 levels."""
    if not len(pairs):
        return np.zeros((0, len(FEATURES)))
    a, b = pairs.T
    link = sections.tip[b] - sections.tip[a]
    length = np.hypot(*link.T)
    radius = np.maximum(sections.end_radius[a], sections.end_radius[b])
    toward = onward = unit(link)
    toward, onward, length = _through(sections, pairs, kind, via, toward, onward, length)
    leaving = angle_between(sections.outward[a], toward)
    arriving = angle_between(onward, -sections.outward[b])
    turn = angle_between(sections.outward[a], -sections.outward[b])
    known = length**2 / (length**2 + (2 * radius) ** 2)
    points, off = _between(sections, a, b, mask)
    color = (sections.color[a] - sections.color[b]) / 100
    brightness = color.mean(axis=1)
    chroma = np.sqrt(((color - brightness[:, None]) ** 2).sum(axis=1))
    width = np.log(sections.end_radius[a] / sections.end_radius[b])
    shared = kind >= SHARED
    gap = np.where(shared, 0.0, np.minimum(length * off.mean(axis=1) / radius, longest) / 4)
    far = np.minimum(length / radius, longest) / 8
    seen = _likeness(sections, a, b, points, off, image)
    columns = (
        np.ones(len(pairs)),
        turn**2,
        known * (leaving**2 + arriving**2),
        np.minimum(width**2, 2.0),
        np.minimum(chroma, 1.0),
        np.minimum(abs(brightness), 1.0),
        gap * (1 - seen),
        far,
        gap * seen,
    )
    features = np.stack(columns, axis=1)
    own = kind == ABSORBED
    features[own] = 0.0
    features[own, 0] = 1.0
    features[own, 3] = _thickening(sections, via[own])
    features[own, 7] = far[own]
    return features


def _through(
    sections: Sections,
    pairs: IntArray,
    kind: IntArray,
    via: IntArray,
    toward: FloatArray,
    onward: FloatArray,
    length: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Directions into and out of the way between the ends, and its length; along a shared section
    its own."""
    shared = np.flatnonzero(kind == SHARED)
    section = via[shared]
    starts_here = sections.node[2 * section] == sections.node[pairs[shared, 0]]
    near, far = 2 * section + ~starts_here, 2 * section + starts_here
    toward, onward, length = toward.copy(), onward.copy(), length.copy()
    toward[shared], onward[shared] = -sections.outward[near], sections.outward[far]
    whole = kind >= SHARED
    length[whole] = sections.length[via[whole]]
    return toward, onward, length


def _between(
    sections: Sections, a: IntArray, b: IntArray, mask: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """``(m, 16, 2)`` points from tip to tip, leaving both ends in their directions, and ``(m, 16)``
    which of them are off the foreground."""
    points = bridge(
        sections.tip[a],
        sections.tip[b],
        sections.outward[a],
        -sections.outward[b],
        np.linspace(0, 1, _SAMPLES),
    )
    return points, read_nearest(mask, points) == 0


def _likeness(
    sections: Sections,
    a: IntArray,
    b: IntArray,
    points: FloatArray,
    off: BoolArray,
    image: ByteArray | None,
) -> FloatArray:
    """``(m,)`` 0 to 1: how far the picture in the gap looks like the ends rather than like what
    is beside them.

    A half where there is no gap or no picture. A DLO may bend in a gap: of several ways to bow, the
    likest counts.
    """
    out = np.full(len(a), 0.5)
    rows = np.flatnonzero(off.any(axis=1))
    if image is None or not len(rows):
        return out
    a, b, points, off = a[rows], b[rows], points[rows], off[rows]
    beside = (sections.beside[a] + sections.beside[b]) / 2
    contrast = np.abs(beside - (sections.color[a] + sections.color[b]) / 2).mean(axis=1)
    width = 0.4 * contrast + NOISE_LEVELS
    radius = np.maximum(sections.end_radius[a], sections.end_radius[b])
    normal = quarter_turned(unit(sections.tip[b] - sections.tip[a]))
    bulge = np.sin(np.linspace(0, np.pi, points.shape[1]))[:, None]
    sideways = bulge * (radius[:, None] * normal)[:, None]
    seen = read_nearest(image, points + np.array(_BOWS_RADII)[:, None, None, None] * sideways)
    own = np.minimum(_away(seen, sections.color[a]), _away(seen, sections.color[b]))
    like = np.exp(-((own / width[:, None]) ** 2))
    out[rows] = ((like * off).sum(axis=2) / off.sum(axis=1)).max(axis=0)
    return out


def _away(seen: FloatArray, colors: FloatArray) -> FloatArray:
    """``(…, m, 16)`` mean absolute difference of ``(…, m, 16, 3)`` colors to ``(m, 3)`` ones."""
    out: FloatArray = np.abs(seen - colors[:, None]).mean(axis=-1)
    return out


def _thickening(sections: Sections, shared: IntArray) -> FloatArray:
    """Logarithm of a shared section's radius over that of the thinner of its neighbors' medians."""
    nodes = sections.node[2 * shared]
    out = np.zeros(len(shared))
    for k, (section, node) in enumerate(zip(shared.tolist(), nodes.tolist(), strict=True)):
        around = np.flatnonzero(
            (sections.node == node) & (np.arange(len(sections.node)) >> 1 != section)
        )
        out[k] = np.log(sections.radius[section] / median(sections.end_radius[around].tolist()))
    return np.clip(out, -1.0, 1.0)
