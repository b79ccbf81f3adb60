"""Topology of harnesses from color and depth, over rendered scenes with shadows: branch-points and
crossings.

    python -m tests.benchmarks.bench_harness_depth [--scenes N] [--sheet FILE]

One harness as in thesis 6.5.1, lit by a lamp whose shadows are as dark as the cables, on a table
0.6 m away; the depth has noise alike in neighboring pixels, holes and flying pixels. Every way goes
through the service's own stage: color and depth, color alone, depth alone, and the true mask.
``--sheet`` writes the scenes whose counts are wrong.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
import io
import json
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from dlo_client.contracts import ImageRef, TopologyRequest
from PIL import Image

from models.strands.stopwatch import Stopwatch
from models.synthesis.depth_sensor import SensorParams
from models.synthesis.harness import HarnessParams
from models.topology.overlay import overlay
from models.weights.inference import Runtime
from tests.benchmarks.harness_depth_scenes import HarnessScene, harness_scene
from tests.benchmarks.topology_scoring import Tally, points_of
from workers.blobs import FolderBlobs
from workers.stages.outcome import Tools
from workers.stages.seen_harness import SeenHarness, see_harness

PARAMS = HarnessParams(
    branch_points=(1, 2), harnesses=(1, 1), cables=(0, 0), cycle_share=0.0, crossings=(0, 3)
)
_SEED, _REACH_PX = (53, 7 * 10**6), 25.0
_WAYS = {
    "color and depth": ("image", "depth"),
    "color": ("image",),
    "depth": ("depth",),
    "true mask": ("mask",),
}


@dataclass
class Score:
    branch: Tally = field(default_factory=Tally)
    crossing: Tally = field(default_factory=Tally)
    dices: list[float] = field(default_factory=list)
    shadows: list[float] = field(default_factory=list)
    right: int = 0

    def summary(self) -> dict[str, float]:
        return {
            "branch_f1": round(self.branch.f1, 3),
            "crossing_f1": round(self.crossing.f1, 3),
            "counts_right": round(self.right / max(len(self.dices), 1), 3),
            "dice": round(float(np.mean(self.dices)), 3),
            "shadow_taken": round(float(np.mean(self.shadows)), 4),
        }


def looked_at(scene: HarnessScene, way: tuple[str, ...], tools: Tools) -> SeenHarness:
    parts = {
        "image": _stored(scene.rgb, tools, "PNG"),
        "depth": _stored(scene.depth_m, tools, "TIFF"),
        "mask": _stored(scene.mask.astype(np.uint8) * 255, tools, "PNG"),
    }
    fields: dict[str, object] = {name: parts[name] for name in way}
    if "depth" in way:
        fields["intrinsics"] = scene.intrinsics
    return see_harness(TopologyRequest.model_validate(fields), tools, Stopwatch())


def _stored(values: np.ndarray, tools: Tools, form: str) -> ImageRef:
    file = io.BytesIO()
    Image.fromarray(values).save(file, form)
    return ImageRef(id=tools.blobs.put(file.getvalue()))


def measure(seen: SeenHarness, scene: HarnessScene, score: Score) -> bool:
    """Whether the counts are right."""
    found, mask = seen.topology, seen.foreground.cable
    true = scene.harness.branch_xy, points_of(scene.harness.crossings)
    same = score.branch.add(
        _inner(points_of(found.branch_points), mask.shape), _inner(true[0], mask.shape), _REACH_PX
    )
    same &= score.crossing.add(
        _inner(points_of(found.crossings), mask.shape), _inner(true[1], mask.shape), _REACH_PX
    )
    score.right += same
    score.dices.append(
        2 * np.count_nonzero(mask & scene.mask) / max(mask.sum() + scene.mask.sum(), 1)
    )
    score.shadows.append(np.count_nonzero(mask & scene.shadow) / max(scene.shadow.sum(), 1))
    return bool(same)


def _inner(points: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Those farther from the border than the reach: there not all arms of a crossing are in
    view."""
    limit = np.array(shape[::-1]) - _REACH_PX
    return points[np.all((points > _REACH_PX) & (points < limit), axis=1)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scenes", type=int, default=48)
    parser.add_argument("--sigma-mm", type=float, default=1.0)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--sheet", type=Path)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    scores = {name: Score() for name in _WAYS}
    wrong: list[np.ndarray] = []
    with tempfile.TemporaryDirectory() as folder:
        tools = Tools(FolderBlobs(Path(folder), 3600.0), 10**7, Runtime(threads=1))
        for k in range(args.first, args.first + args.scenes):
            rng = np.random.default_rng([_SEED[0], _SEED[1] + k])
            scene = harness_scene(rng, PARAMS, SensorParams(sigma_m=args.sigma_mm / 1000))
            for name, way in _WAYS.items():
                seen = looked_at(scene, way, tools)
                if not measure(seen, scene, scores[name]) and name == "color and depth":
                    wrong.append(overlay(scene.rgb, seen.topology)[..., ::-1])
    report = {
        "scenes": args.scenes,
        "sigma_mm": args.sigma_mm,
        "ways": {n: s.summary() for n, s in scores.items()},
    }
    print(json.dumps(report))
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "harness_depth.json").write_text(json.dumps(report, indent=1))
    if args.sheet and wrong:
        cv2.imwrite(str(args.sheet), np.vstack(wrong))


if __name__ == "__main__":
    main()
