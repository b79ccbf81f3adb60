"""The topology of harnesses: synthetic held-out scenes, real masks and photographs, single
components, ablation, time.

    python -m tests.benchmarks.bench_topology [SHARED] [--scenes 280] [--sheet FILE]

Held-out scenes come from a part of the seed that neither training (0 and 5e5 on) nor tuning (2e6
on) uses. Figures are counted as in thesis Table 6.1 (``topology_scoring``). Prints tables and
writes ``build/bench/topology.json``; ``--sheet`` writes the worst overlays.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from time import thread_time

import cv2
import numpy as np

from models.instances.published.rt_dlo.graph import sample_vertices, select_edges
from models.instances.settling import settle
from models.segmentation.effort import look
from models.segmentation.segment import ForegroundInput, foreground_mask
from models.strands.foreground import distance_map
from models.strands.graph import Web
from models.synthesis.harness import Harness, HarnessParams
from models.synthesis.harness_growth import make_harness
from models.synthesis.harness_masks import MaskParams, draw_mask
from models.topology.classifiers import Classifiers
from models.topology.evidence import classifiers_of
from models.topology.extraction import extract, predict
from models.topology.graph import Graph, initialize
from models.topology.harness_drawing import match_drawing
from models.topology.overlay import overlay
from models.topology.scene import Topology
from models.training.topology.graphs import true_graph
from models.training.topology.train import SIZES
from models.weights.inference import Network, Runtime, default_name, eight_bit, load
from tests.benchmarks.bench_instances import photos
from tests.benchmarks.drawn_harnesses import drawing_of, nearest_branch
from tests.benchmarks.scoring import score_labels
from tests.benchmarks.topology_scoring import Tally, link_dice, points_of

HELD_OUT = (11, 10**6)
"""Seed and first scene of the held-out part; training takes the scenes from 0 on."""
THESIS = HarnessParams(
    branch_points=(1, 2), harnesses=(1, 1), cables=(0, 0), cycle_share=0.0, crossings=(0, 3)
)
"""As in 6.5.1: one harness of at most five sections and two branch-points; its masks are disturbed
all the same."""
SYNTHETIC_REACH_PX, BWH_REACH_PX = 25.0, 30.0


@dataclass(frozen=True)
class Tools:
    """The shipped networks on one thread."""

    network: Network
    classifiers: Classifiers
    orientation: Network
    moves: Network

    def extract(self, mask: np.ndarray, image: np.ndarray | None = None) -> Topology:
        return extract(mask, self.network, self.classifiers, image)


def tools() -> Tools:
    def network(task: str) -> Network:
        return load(default_name(task), Runtime(threads=1))

    classifiers = classifiers_of(network)
    return Tools(network("topology"), classifiers, network("orientation"), network("moves"))


def held_out(
    count: int, params: Callable[[int], HarnessParams], disturbed: MaskParams
) -> list[tuple[Harness, np.ndarray]]:
    """Scenes and their masks, the same every time."""
    scenes = []
    for k in range(count):
        rng = np.random.default_rng([HELD_OUT[0], HELD_OUT[1] + k])
        harness = make_harness(rng, params(k))
        scenes.append((harness, draw_mask(harness, rng, disturbed)))
    return scenes


def synthetic(
    kit: Tools, count: int, params: HarnessParams, disturbed: MaskParams
) -> tuple[dict, list]:
    """Table 6.1 on held-out scenes, and the scenes that were not all right."""
    branch, crossing, dices, right, worst = Tally(), Tally(), [], 0, []
    for harness, mask in held_out(
        count, lambda k: replace(params, size=SIZES[k % len(SIZES)]), disturbed
    ):
        topology = kit.extract(mask)
        graph = initialize(mask)
        if not graph.edges.shape[1]:
            continue
        dices.append(link_dice(topology.links, true_graph(harness, graph).pairs))
        true_crossings = points_of(harness.crossings)
        seen = [
            _inner(p, mask.shape)
            for p in (
                points_of(topology.branch_points),
                harness.branch_xy,
                points_of(topology.crossings),
                true_crossings,
            )
        ]
        same = branch.add(seen[0], seen[1], SYNTHETIC_REACH_PX)
        same &= crossing.add(seen[2], seen[3], SYNTHETIC_REACH_PX)
        right += same
        if not same:
            worst.append((mask, topology, harness.branch_xy, true_crossings))
    return {
        "scenes": len(dices),
        "link_dice": round(float(np.mean(dices)), 4),
        "branch_accuracy": round(branch.accuracy, 4),
        "branch_f1": round(branch.f1, 4),
        "crossing_accuracy": round(crossing.accuracy, 4),
        "crossing_f1": round(crossing.f1, 4),
        "counts_right": round(right / max(len(dices), 1), 4),
        "branch": vars(branch),
        "crossing": vars(crossing),
    }, worst


def _inner(points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Points farther from the border than the reach: of a crossing at the border not all four arms
    are in view."""
    limit = np.array(shape[::-1]) - SYNTHETIC_REACH_PX
    return points[np.all((points > SYNTHETIC_REACH_PX) & (points < limit), axis=1)]


def components(kit: Tools, count: int) -> dict:
    """Fig. 6.12: precision and recall of links and node classes, orientation errors; Fig. 6.14:
    RT-DLO's instead."""
    links, classes, errors, theirs, rt_dices = [], [], [], [], []
    for harness, mask in held_out(
        count, lambda k: HarnessParams(size=SIZES[k % len(SIZES)]), MaskParams()
    ):
        graph = initialize(mask)
        if not graph.edges.shape[1]:
            continue
        truth, said = true_graph(harness, graph), predict(graph, kit.network)
        links.append((said.links, truth.links))
        classes.append((said.classes.max(axis=1), truth.classes.any(axis=1)))
        errors.append(_apart(said.angles, truth.angles)[truth.on])
        vertices = sample_vertices(distance_map(mask), None, 0.15, kit.orientation)
        if len(vertices.xy) > 1:
            rival = _as_graph(
                vertices.xy, vertices.radii, select_edges(vertices, mask, 8, 0.1), graph
            )
            rt_truth = true_graph(harness, rival)
            rt_dices.append(link_dice(rival.edges.T, rt_truth.pairs))
            angles = np.arctan2(vertices.directions[:, 1], vertices.directions[:, 0])
            theirs.append(_apart(angles, rt_truth.angles)[rt_truth.on])
    ours, rts = np.concatenate(errors), np.concatenate(theirs)
    return {
        "links": _curve(links),
        "classes": _curve(classes),
        "orientation_deg": {
            "mean": round(float(ours.mean()), 2),
            "spread": round(float(ours.std()), 2),
            "median_absolute": round(float(np.median(np.abs(ours))), 2),
        },
        "ablation": {
            "rt_dlo_link_dice": round(float(np.mean(rt_dices)), 4),
            "rt_dlo_orientation_median_deg": round(float(np.median(np.abs(rts))), 2),
            "orientation_median_deg": round(float(np.median(np.abs(ours))), 2),
        },
    }


def _as_graph(xy: np.ndarray, radii: np.ndarray, edges: np.ndarray, like: Graph) -> Graph:
    pairs = np.sort(edges, axis=1).T.astype(np.int64)
    return Graph(
        xy,
        radii,
        like.spacing,
        pairs,
        np.ones(pairs.shape[1], bool),
        (),
        Web(np.zeros((0, 2)), ()),
        like.distances,
    )


def _apart(angles: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Signed differences of undirected orientations, -90 to 90 degrees."""
    return np.mod(np.rad2deg(angles - true) + 90, 180) - 90


def _curve(pairs: list[tuple[np.ndarray, np.ndarray]]) -> list[dict]:
    said, true = (np.concatenate(side) for side in zip(*pairs, strict=True))
    rows = []
    for threshold in (0.05, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95):
        found = said >= threshold
        hits = int((found & true).sum())
        rows.append(
            {
                "threshold": threshold,
                "precision": round(hits / max(int(found.sum()), 1), 4),
                "recall": round(hits / max(int(true.sum()), 1), 4),
            }
        )
    return rows


def wh1(kit: Tools, root: Path) -> dict:
    """One branch-point each; one crossing in each ``before``, none in ``after``."""
    rows = {}
    for path in sorted((root / "data/wh1/masks").glob("*.png")):
        topology = kit.extract(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 0)
        found = (len(topology.branch_points), len(topology.crossings))
        rows[path.stem] = {
            "branch_points": found[0],
            "crossings": found[1],
            "right": found == (1, int("before" in path.stem)),
        }
    return {"right": sum(r["right"] for r in rows.values()), "of": len(rows), "masks": rows}


def bwh(kit: Tools, root: Path, source: str) -> tuple[dict, list]:
    """``source``: ``mask`` the true masks, ``mask+color`` with the picture's colors, ``rgb`` the
    foreground as the service answers it."""
    nodes = json.loads((root / "data/bwh/nodes.json").read_text())
    branch, crossing, right, worst = Tally(), Tally(), 0, []
    name = default_name("foreground")
    net = load(eight_bit(name), Runtime(threads=1))
    settings = ForegroundInput.from_manifest(net.spec.preprocess)
    for stem, marks in sorted(nodes.items()):
        image = np.ascontiguousarray(
            cv2.imread(str(root / f"data/bwh/imgs/{stem}.jpg"))[:, :, ::-1]
        )
        if source == "rgb":
            seen = look(image, net, settings)
            mask = settle(image, seen, foreground_mask(seen, settings), settings.threshold).cable
        else:
            mask = cv2.imread(str(root / f"data/bwh/masks/{stem}.png"), cv2.IMREAD_GRAYSCALE) > 127
        topology = kit.extract(mask, None if source == "mask" else image)
        points, crossings = (
            np.array(marks[k]).reshape(-1, 2) for k in ("branch_points", "crossings")
        )
        same = branch.add(points_of(topology.branch_points), points, BWH_REACH_PX)
        same &= crossing.add(points_of(topology.crossings), crossings, BWH_REACH_PX)
        right += same
        if not same:
            worst.append((mask, topology, points, crossings))
    return {
        "branch_f1": round(branch.f1, 4),
        "crossing_f1": round(crossing.f1, 4),
        "counts_right": round(right / len(nodes), 4),
        "images": len(nodes),
        "branch": vars(branch),
        "crossing": vars(crossing),
    }, worst


def identity(kit: Tools, count: int) -> dict:
    """Branches named by the drawing: trees in view whose branches differ by a tenth or more in
    length."""
    right = total = skipped = k = 0
    while total < 5 * count and k < 40 * count:
        rng = np.random.default_rng([29, k])
        k += 1
        params = HarnessParams(
            branch_points=(1, 5), harnesses=(1, 1), cables=(0, 0), cycle_share=0.0, crossings=(0, 2)
        )
        harness = make_harness(rng, params)
        lengths = sorted(len(s.xy) for s in harness.sections)
        inside = all(((s.xy > 2) & (s.xy < [637, 477])).all() for s in harness.sections)
        if not inside or any(b < 1.1 * a for a, b in pairwise(lengths)):
            skipped += 1
            continue
        topology = kit.extract(draw_mask(harness, rng, MaskParams(connectors=0)))
        match = match_drawing(topology, drawing_of(harness, rng.uniform(0.2, 0.6)))
        for name, found in match.sections.items():
            line = np.concatenate([topology.sections[i].xy for i in found])
            right += nearest_branch(harness, line) == int(name)
        total += len(harness.sections)
    return {"branches": total, "right": right, "share": round(right / max(total, 1), 4)}


def as_instances(kit: Tools, root: Path, name: str) -> dict:
    """Fig. 6.13: every section an instance, as wide as it is, clipped to the mask."""
    dices, rows = [], list(photos(root, name))
    for photo in rows:
        topology = kit.extract(photo.mask, photo.image)
        labels = np.zeros(photo.mask.shape, np.uint8)
        for k, section in enumerate(topology.sections[:255], start=1):
            line = np.rint(section.xy * 16).astype(np.int32)
            cv2.polylines(
                labels, [line], section.closed, k, max(1, round(1.1 * section.width)), shift=4
            )
        dices.append(score_labels(labels * photo.mask, photo.labels)["dice"])
    return {
        "images": len(rows),
        "dice": round(float(np.mean(dices)), 4),
        "median": round(float(np.median(dices)), 4),
    }


def times(kit: Tools, root: Path, repeats: int = 9) -> dict:
    """Table 6.2: processor time of one thread on the ``wh1`` masks, 640 x 480, best of the
    repeats."""
    totals, parts = [], {}
    for path in sorted((root / "data/wh1/masks").glob("*.png")):
        mask = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) > 0
        runs = []
        for _ in range(repeats):
            started = thread_time()
            topology = kit.extract(mask)
            runs.append((1e3 * (thread_time() - started), topology.timings_ms))
        best = min(runs, key=lambda r: r[0])
        totals.append(best[0])
        for part, ms in best[1].items():
            parts.setdefault(part, []).append(ms)
    return {
        "total_ms": round(float(np.mean(totals)), 1),
        "worst_ms": round(max(totals), 1),
        "parts_ms": {k: round(float(np.median(v)), 1) for k, v in parts.items()},
    }


def sheet(cases: list) -> np.ndarray:
    """Overlays with the truth as rings, four a row, BGR."""
    tiles = []
    for mask, topology, branches, crossings in cases[:16]:
        picture = overlay(np.repeat(mask[:, :, None], 3, axis=2).astype(np.uint8) * 160, topology)
        for points, color in ((branches, (255, 90, 90)), (crossings, (90, 160, 255))):
            for x, y in np.asarray(points).reshape(-1, 2):
                cv2.circle(picture, (round(x), round(y)), 16, color, 2, cv2.LINE_AA)
        tiles.append(cv2.resize(picture, (640, 420))[:, :, ::-1])
    tiles += [np.zeros((420, 640, 3), np.uint8)] * (-len(tiles) % 4 or (0 if tiles else 4))
    return np.vstack([np.hstack(tiles[k : k + 4]) for k in range(0, len(tiles), 4)])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path, nargs="?", default=Path("../shared"))
    parser.add_argument("--scenes", type=int, default=280)
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    cv2.setNumThreads(1)
    kit = tools()
    held, bad = synthetic(kit, args.scenes, HarnessParams(), MaskParams())
    plain, _ = synthetic(kit, args.scenes, THESIS, MaskParams())
    print("synthetic", json.dumps(held), flush=True)
    print("synthetic, as 6.5.1", json.dumps(plain), flush=True)
    results: dict = {"synthetic": held, "synthetic_thesis": plain, "wh1": wh1(kit, args.shared)}
    print("wh1", results["wh1"]["right"], "of", results["wh1"]["of"], flush=True)
    for source in ("mask", "mask+color", "rgb"):
        results[f"bwh_{source}"], wrong = bwh(kit, args.shared, source)
        print("bwh", source, json.dumps(results[f"bwh_{source}"]), flush=True)
        bad = wrong + bad if source != "mask+color" else bad
    results["identity"] = identity(kit, 60)
    print("identity", json.dumps(results["identity"]), flush=True)
    results["components"] = components(kit, min(args.scenes, 120))
    print("components", json.dumps(results["components"]), flush=True)
    results["instances"] = {name: as_instances(kit, args.shared, name) for name in ("ewd", "sbhc")}
    print("as instances", json.dumps(results["instances"]), flush=True)
    results["time"] = times(kit, args.shared)
    print("time", json.dumps(results["time"]))
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "topology.json").write_text(json.dumps(results, indent=1))
    if args.sheet:
        cv2.imwrite(str(args.sheet), sheet(bad))


if __name__ == "__main__":
    main()
