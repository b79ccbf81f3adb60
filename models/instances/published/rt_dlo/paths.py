"""From a graph without branches to one ordered vertex path a DLO (thesis 3.5.5)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.geometry.directions import unit
from models.geometry.polylines import arc_lengths
from models.geometry.sampling import read_nearest
from models.instances.published.rt_dlo.arms import (
    ARM_RADII,
    Arm,
    arm_of,
    color_likeness,
    continuation,
)
from models.instances.published.rt_dlo.graph import Vertices
from models.instances.published.rt_dlo.intersections import Graph, chain_from
from models.strands.pairing import greedy
from models.strands.walks import follow

_MAX_PATHS = 400
_JOINT_RADII = 24.0
"""Longest joint, over a gap or where two strands share their foreground."""
_SHARP_COSINE = 0.5
"""Of a turn within a path, or from an end into a joint, that is no smooth one."""
_LEAST_LIKE = 0.5
"""Likeness in color of the two sides of a kink in one DLO."""


@dataclass(frozen=True)
class Path:
    """Vertices in order. A closed path does not repeat its first vertex."""

    vertices: tuple[int, ...]
    closed: bool = False


def extract_paths(graph: Graph) -> list[Path]:
    """The chains and rings of a graph whose vertices have at most two edges, longest first."""
    seen: set[int] = set()
    paths = []
    ends = sorted(v for v, around in graph.items() if len(around) == 1)
    for start in [*ends, *sorted(graph)]:
        if start not in seen and graph[start]:
            chain = chain_from(graph, start)
            seen.update(chain)
            paths.append(Path(tuple(chain), closed=len(chain) > 2 and chain[0] in graph[chain[-1]]))
    return sorted(paths, key=lambda path: -len(path.vertices))[:_MAX_PATHS]


def split_at_kinks(path: Path, vertices: Vertices) -> list[Path]:
    """Consistency check: an open path is cut where it is not smooth; joining may undo what has no
    better end.

    Not smooth is a vertex whose two edges leave to the same side of it (thesis 3.5.5), and, beyond
    the thesis, the sharpest vertex of a turn by more than 60 degrees within a few radii.
    """
    xy = vertices.xy[list(path.vertices)]
    if path.closed or len(xy) < 3:
        return [path]
    cuts = np.union1d(
        _one_sided(xy, vertices.directions[list(path.vertices)]), _sharp_turns(xy, vertices)
    )
    bounds = [0, *(cuts + 1).tolist(), len(xy)]
    pieces = [path.vertices[a:b] for a, b in pairwise(bounds)]
    return [Path(piece) for piece in pieces if len(piece) > 1]


def _one_sided(xy: FloatArray, directions: FloatArray) -> IntArray:
    before = np.einsum("ij,ij->i", directions[1:-1], xy[1:-1] - xy[:-2])
    after = np.einsum("ij,ij->i", directions[1:-1], xy[2:] - xy[1:-1])
    return np.flatnonzero(before * after < 0) + 1


def _sharp_turns(xy: FloatArray, vertices: Vertices) -> IntArray:
    """The vertex of the largest turn in each stretch of vertices where the path turns sharply."""
    reach = max(
        1, round(ARM_RADII * vertices.typical_radius * (len(xy) - 1) / float(arc_lengths(xy)[-1]))
    )
    if len(xy) <= 2 * reach:
        return np.zeros(0, dtype=np.int64)
    steps = unit(xy[reach:] - xy[:-reach])
    cosines = np.einsum("ij,ij->i", steps[:-reach], steps[reach:])
    sharp = np.flatnonzero(cosines < _SHARP_COSINE)
    stretches = np.split(sharp, np.flatnonzero(np.diff(sharp) > 1) + 1)
    return np.array([s[np.argmin(cosines[s])] + reach for s in stretches if len(s)], dtype=np.int64)


def join_paths(cut: list[list[Path]], vertices: Vertices, mask: BoolArray) -> list[Path]:
    """Paths connected end to end where one seems to go on in the other: over gaps, along shared
    foreground.

    ``cut``: the pieces of each path in order, as :func:`split_at_kinks` gives them.

    Strategy: every pair of ends within reach gets a score (how well one continues the other, less
    for length and for foreground missing between them). Pairs are joined in descending order, each
    end once; joining the two ends of one path closes it. A cut whose two sides found nothing better
    is undone: a DLO has a kink there, or two DLOs of other colors meet. End ``2 p`` is the first
    vertex of open path ``p``, end ``2 p + 1`` its last.
    """
    open_paths = [path for pieces in cut for path in pieces if not path.closed]
    arms = [arm_of(chain, vertices) for p in open_paths for chain in (p.vertices, p.vertices[::-1])]
    partner = greedy(len(arms), *_scored_joints(arms, mask), 0.0)
    for a in _cut_ends(cut):
        if partner[a] == a and partner[a + 1] == a + 1 and _of_one_color(arms[a], arms[a + 1]):
            partner[a], partner[a + 1] = a + 1, a
    return [path for pieces in cut for path in pieces if path.closed] + _joined(open_paths, partner)


def _cut_ends(cut: list[list[Path]]) -> list[int]:
    """The end before each cut; the end after it is the next one."""
    last = np.cumsum([0, *(len(pieces) for pieces in cut if not pieces or not pieces[0].closed)])
    return [2 * k - 1 for start, stop in pairwise(last.tolist()) for k in range(start + 1, stop)]


def _of_one_color(a: Arm, b: Arm) -> bool:
    return color_likeness(a.color, b.color) > _LEAST_LIKE


def _scored_joints(arms: list[Arm], mask: BoolArray) -> tuple[IntArray, FloatArray]:
    """``(m, 2)`` ends of the joints that are possible, and their scores ``(m,)``."""
    if len(arms) < 2:
        return np.zeros((0, 2), np.int64), np.zeros(0)
    xy, outward = np.array([arm.xy for arm in arms]), np.array([arm.outward for arm in arms])
    radii = np.array([arm.radius for arm in arms])
    a, b = np.triu_indices(len(arms), 1)
    link = xy[b] - xy[a]
    length, toward = np.hypot(*link.T), unit(link)
    leaving = np.einsum("ij,ij->i", outward[a], toward)
    arriving = -np.einsum("ij,ij->i", outward[b], toward)
    radius = np.maximum(radii[a], radii[b])
    smooth = np.minimum(leaving, arriving) > _SHARP_COSINE
    near = np.flatnonzero((length < _JOINT_RADII * radius) & smooth)
    a, b, length, radius = a[near], b[near], length[near] / radius[near], radius[near]
    shares = np.linspace(0, 1, 24)[None, :, None]
    on_mask = read_nearest(mask, xy[a][:, None] * (1 - shares) + xy[b][:, None] * shares).mean(
        axis=1
    )
    gap = length * (1 - on_mask)
    fit = np.array([continuation(arms[i], arms[j]) for i, j in zip(a, b, strict=True)])
    return np.stack((a, b), axis=1), fit / (1 + (gap + length) / _JOINT_RADII)


def _joined(paths: list[Path], partner: IntArray) -> list[Path]:
    """The paths strung together."""
    joined = []
    for entered, ring in follow(partner):
        pieces = [paths[end // 2].vertices[:: -1 if end % 2 else 1] for end in entered]
        joined.append(Path(tuple(v for piece in pieces for v in piece), ring))
    return joined
