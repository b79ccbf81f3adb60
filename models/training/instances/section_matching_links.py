"""Fit the weights of the link model on rendered scenes with worn masks.

    python -m models.training.instances.section_matching_links [--textures PACK] [--scenes 500]

One logistic regression per kind of link, its weights bounded so that a worse measurement never
makes a link more likely. A minute on one core; the same seed gives the same file
(``link_weights.toml`` beside this one).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import tomli_w
import torch

from models.geometry.arrays import BoolArray, FloatArray, IntArray
from models.instances.section_matching.extraction import SectionMatchingParams
from models.instances.section_matching.links import (
    ABSORBED,
    FEATURES,
    KINDS,
    WEIGHTS_FILE,
    Links,
    candidate_links,
)
from models.strands.cleaning import clean
from models.strands.pixel_graph import trace
from models.strands.sections import Sections, sections_of
from models.synthesis.textures import load_pool
from models.training.instances.logistic import fit_logistic
from models.training.instances.section_matching_scenes import CurveIndex, TrainScene, make_scene

_SHRINKAGE = 2e-4
_SEED = 21
_CUT_SHARE = 0.15
"""More than in life: ends that face each other and are not one cable's are seldom met and must be
learned."""


def measured(scene: TrainScene) -> tuple[Sections, Links]:
    """The sections of a scene and their candidate links, as the method sees them."""
    params = SectionMatchingParams()
    cleaned = clean(scene.mask, params.hole_widths)
    sections = sections_of(trace(cleaned, halve=False), cleaned.distances, scene.image)
    return sections, candidate_links(sections, cleaned.mask, scene.image, params.gap_widths)


def truths(sections: Sections, links: Links, curves: CurveIndex) -> tuple[BoolArray, BoolArray]:
    """``(m,)`` whether each link is right, and whether that is known.

    A link is right if both ends lie on one cable, face each other along it, and are next to each
    other.
    """
    at = [
        curves.strand_at(tip, out, 0.8 * r + 2)
        for tip, out, r in zip(sections.tip, sections.outward, sections.end_radius, strict=True)
    ]
    right, known = np.zeros(len(links.pairs), bool), np.zeros(len(links.pairs), bool)
    for k, (a, b) in enumerate(links.pairs.tolist()):
        first, second = at[a], at[b]
        if links.kind[k] == ABSORBED:
            points = sections.points(a >> 1)
            middle = len(points) // 2
            along = points[min(middle + 3, len(points) - 1)] - points[max(middle - 3, 0)]
            along = along / max(float(np.hypot(*along)), 1e-9)
            reach = float(sections.radius[a >> 1]) + 1
            right[k], known[k] = curves.strands_through(points[middle], along, reach) > 1, True
            continue
        known[k] = first is not None or second is not None
        if first is None or second is None or first[0] != second[0]:
            continue
        way = second[1] - first[1]
        direct = float(np.hypot(*(sections.tip[b] - sections.tip[a])))
        faces = first[2] * way > -3 and second[2] * way < 3
        right[k] = faces and abs(way) < 1.6 * direct + 4 * sections.end_radius[a] + 4
    return right, known


def fit(features: FloatArray, right: BoolArray) -> FloatArray:
    """Costs' weights ``(9,)``: minus the logistic regression's, all but the constant and width
    bounded below by 0."""
    bounds: list[tuple[float | None, float | None]] = [(None, None)] + [(None, 0.0)] * (
        features.shape[1] - 1
    )
    if not features[:, 1].any():  # sections' own ends: thickness speaks for sharing
        bounds[3] = (0.0, None)
    shrinkage = np.append(0.0, np.full(features.shape[1] - 1, _SHRINKAGE))
    return -fit_logistic(features, right, shrinkage, bounds)


def collect(count: int, textures: Path | None) -> tuple[FloatArray, IntArray, BoolArray]:
    """Features, kinds and truths of all candidate links of ``count`` scenes."""
    pool = load_pool(textures)
    parts = []
    for k in range(count):
        scene = make_scene(np.random.default_rng([_SEED, k]), pool, cut_share=_CUT_SHARE)
        sections, links = measured(scene)
        if scene.curves and len(links.pairs):
            right, known = truths(sections, links, CurveIndex.of(scene.curves))
            parts.append((links.features[known], links.kind[known], right[known]))
    features, kinds, right = (np.concatenate(column) for column in zip(*parts, strict=True))
    return features, kinds, right


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--textures", type=Path, help="a pack of background pictures; without it they are noise"
    )
    parser.add_argument("--scenes", type=int, default=300)
    args = parser.parse_args()
    torch.set_num_threads(1)
    features, kinds, right = collect(args.scenes, args.textures)
    table = {}
    for kind, name in enumerate(KINDS):
        mine = kinds == kind
        weights = fit(features[mine], right[mine])
        print(name, int(mine.sum()), f"{right[mine].mean():.3f}", np.round(weights, 2), flush=True)
        table[name] = {f: round(float(w), 4) for f, w in zip(FEATURES, weights, strict=True)}
    note = {
        "command": "python -m models.training.instances.section_matching_links",
        "scenes": args.scenes,
        "seed": _SEED,
        "links": len(right),
    }
    WEIGHTS_FILE.write_text(tomli_w.dumps({"made_by": note, **table}))


if __name__ == "__main__":
    main()
