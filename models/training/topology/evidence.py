"""The evidence that the classifiers learn from, and the truth that synthetic scenes know about
it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from models.geometry.arrays import ByteArray, Float32Array, FloatArray, IntArray
from models.geometry.polylines import arc_lengths, point_at
from models.strands.foreground import distance_map
from models.strands.graph import Web
from models.synthesis.harness import FREE, Harness, HarnessParams, TrueSection
from models.synthesis.harness_curves import STEP_PX
from models.synthesis.harness_masks import MaskParams
from models.topology.bridges import Bridge, End, free_ends, proposals
from models.topology.classifiers import Classifiers
from models.topology.extraction import TopologyNetwork, predict
from models.topology.graph import Graph
from models.topology.repair import pruned, repaired
from models.topology.scene import Predictions
from models.topology.sites import Reading, Site, crossing_sites, evidence
from models.topology.stubs import Candidate, candidates
from models.training.topology.graphs import draw_scene
from models.training.topology.train import SIZES

_SAME_WAY = np.cos(np.deg2rad(40))


@dataclass(frozen=True, eq=False)
class Table:
    """Evidence: ``rows`` ``(n, features)`` and ``truths`` ``(n,)``: 0 or 1, or a
    :class:`sites.Reading`."""

    rows: Float32Array
    truths: IntArray

    def __len__(self) -> int:
        return len(self.truths)


@dataclass(frozen=True, eq=False)
class Scene:
    """A scene and what the network gives for it; its distances are kept as a packed mask, to hold
    thousands."""

    harness: Harness
    predictions: Predictions
    bare: Graph
    packed: ByteArray
    size: tuple[int, int]

    @property
    def graph(self) -> Graph:
        mask = (
            np.unpackbits(self.packed, count=self.size[0] * self.size[1])
            .reshape(self.size)
            .astype(bool)
        )
        return replace(self.bare, distances=distance_map(mask))


def scenes(seed: int, first: int, count: int, network: TopologyNetwork) -> list[Scene]:
    """Scenes ``first`` to ``first + count`` of a seed."""
    found = []
    for k in range(first, first + count):
        params = HarnessParams(size=SIZES[k % len(SIZES)])
        harness, graph = draw_scene(np.random.default_rng([seed, k]), params, MaskParams())
        bare = replace(graph, distances=np.zeros((0, 0), np.float32))
        packed = np.packbits(graph.distances > 0)
        found.append(Scene(harness, predict(graph, network), bare, packed, harness.size))
    return found


def stub_table(seen: list[Scene]) -> Table:
    """Evidence of short strands."""
    stubs: list[tuple[Sequence[float], bool]] = []
    for scene in seen:
        harness, graph, predictions = scene.harness, scene.graph, scene.predictions
        stubs += [
            (c.evidence, is_branch(harness, graph, c)) for c in candidates(graph, predictions)
        ]
    return _table(stubs)


def bridge_table(seen: list[Scene], classifiers: Classifiers) -> Table:
    """Evidence of bridges, after short strands were probabilities_of."""
    bridges: list[tuple[Sequence[float], bool]] = []
    for scene in seen:
        harness, graph, predictions = scene.harness, scene.graph, scene.predictions
        real = pruned(graph, predictions, classifiers)
        ends = {e.knot: e for e in free_ends(real)}
        bridges += [
            (b.evidence, goes_on(harness, real, ends, b)) for b in proposals(real, predictions)
        ]
    return _table(bridges)


def crossing_table(seen: list[Scene], classifiers: Classifiers) -> Table:
    """Evidence of crossings and lenses, after the strands were repaired."""
    sites: list[tuple[Sequence[float], int]] = []
    for scene in seen:
        harness, graph, predictions = scene.harness, scene.graph, scene.predictions
        web = repaired(graph, predictions, classifiers)
        sites += [
            (evidence(s, web, graph.xy, predictions), true_reading(s, web, harness))
            for s in crossing_sites(web)
        ]
    return _table(sites)


def _table(rows: Sequence[tuple[Sequence[float], int]]) -> Table:
    return Table(
        np.array([r for r, _ in rows], np.float32), np.array([t for _, t in rows], np.int64)
    )


def true_reading(site: Site, web: Web, harness: Harness) -> Reading:
    """A crossing if one lies at the middle of the site, or beside it and the arms that it would
    join lie on the same sections: a gap bends the arms. A lens if the same two sections cross near
    both joints."""
    width = max(a.width for a in site.arms)
    length = web.strands[site.middle].length if site.middle is not None else 0.0
    reach = max(0.35 * length, 0.8 * width, 6.0)
    if site.middle is not None:
        ends = [
            {
                (m.a, m.b): m
                for m in harness.crossings
                if np.hypot(*(m.xy - web.knots_xy[k])) <= reach
            }
            for k in site.knots
        ]
        if any(ends[0][who] is not ends[1][who] for who in ends[0].keys() & ends[1].keys()):
            return Reading.LENS
    nearest = min((float(np.hypot(*(m.xy - site.xy))) for m in harness.crossings), default=np.inf)
    if nearest <= reach or (nearest <= reach + width + 4 and _joined(site, harness)):
        return Reading.CROSSING
    return Reading.BRANCH_POINTS


def _joined(site: Site, harness: Harness) -> bool:
    """Whether both pairs of arms that a crossing would join lie on one section each."""
    outer = [a.xy + a.width * a.heading for a in site.arms]
    away = [[np.hypot(*(s.xy - xy).T).min() / s.width for s in harness.sections] for xy in outer]
    section = np.argmin(away, axis=1)
    return all(section[i] == section[j] for i, j in site.pairs)


def is_branch(harness: Harness, graph: Graph, candidate: Candidate) -> bool:
    """Whether the middle half of a strand follows a section, or the outer one of a strand with a
    free end: a branch may end in a connector."""
    strand = graph.web.strands[candidate.strand]
    line = strand.xy[::-1] if strand.a == candidate.tip else strand.xy
    count = len(line)
    parts = [
        line[count // 4 : count - count // 4],
        *([line[count // 2 :]] if candidate.tip >= 0 else []),
    ]
    return any(_follows(part, s) for s in harness.sections for part in parts)


def _follows(line: FloatArray, section: TrueSection) -> bool:
    away = np.hypot(*np.moveaxis(line[:, None] - section.xy[None], -1, 0))
    if float(np.median(away.min(axis=1))) > 0.45 * section.width + 1.5:
        return False
    first, last = section.xy[int(away[0].argmin())], section.xy[int(away[-1].argmin())]
    ahead, step = last - first, line[-1] - line[0]
    size = float(np.hypot(*ahead) * np.hypot(*step))
    # A clip leaves the section at a right angle: its nearest point of the section stays where it
    # is.
    return bool(
        np.hypot(*ahead) > 0.5 * np.hypot(*step)
        and abs(float(ahead @ step)) > _SAME_WAY * max(size, 1e-9)
    )


def goes_on(harness: Harness, graph: Graph, ends: dict[int, End], bridge: Bridge) -> bool:
    """Whether the section that the end lies on leads to where the bridge does."""
    end, there = ends[bridge.nodes[0]], bridge.nodes[-1]
    if there in ends and not _on_section(harness, ends[there]):
        return False
    return any(
        _leads(harness, s, end, graph.xy[there], 2 * float(graph.radii[there]))
        for s in _under(harness, end)
    )


def _under(harness: Harness, end: End) -> list[TrueSection]:
    """The sections that lie under a free end, along it."""
    return [s for s in harness.sections if _at(s, end) is not None]


def _on_section(harness: Harness, end: End) -> bool:
    return bool(_under(harness, end))


def _at(section: TrueSection, end: End) -> tuple[float, float] | None:
    """Arc length of the end on a section and which way it points there (1 or -1); None if it is not
    its end."""
    away = np.hypot(*(section.xy - end.xy).T)
    k = int(away.argmin())
    if away[k] > 0.6 * section.width + 3:
        return None
    tangent = section.xy[min(k + 1, len(section.xy) - 1)] - section.xy[max(k - 1, 0)]
    cosine = float(tangent @ end.heading) / max(float(np.hypot(*tangent)), 1e-9)
    return None if abs(cosine) < _SAME_WAY else (STEP_PX * k, float(np.sign(cosine)))


def _leads(
    harness: Harness, section: TrueSection, end: End, there: FloatArray, width: float
) -> bool:
    placed = _at(section, end)
    if placed is None:
        return False
    at, way = placed
    lengths = arc_lengths(section.xy)
    reach = float(np.hypot(*(there - end.xy)))
    left = float(lengths[-1]) - at if way > 0 else at
    ahead = point_at(section.xy, lengths, np.array([np.clip(at + way * reach, 0, lengths[-1])]))[0]
    beyond = reach - left
    branch = section.ends[1 if way > 0 else 0]
    slack = 0.6 * max(width, section.width) + 3
    if beyond > 0.5 * section.width + 2:
        if branch == FREE:
            return False
        return bool(np.hypot(*(harness.branch_xy[branch] - there)) < slack + 0.7 * beyond)
    return bool(np.hypot(*(ahead - there)) < slack)
