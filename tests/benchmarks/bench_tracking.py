"""Which cable is which, over rendered clips: IDF1, switches, drift along the cable, time beside the instances.

    python -m tests.benchmarks.bench_tracking [--clips N] [--frames N]

Four cables of one look move; in the second set an arm covers a good part of the picture for 30 frames. The masks are
true, the instances those of the default method. Baselines: the nearest curve, and the largest overlap, frame by frame.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from time import process_time

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from models.geometry.polylines import arc_lengths, resample
from models.instances.scene import Scene
from models.instances.section_matching import extract
from models.synthesis.clips import ClipParams, Frame, render_clip
from models.synthesis.scenes import to_uint8
from models.synthesis.textures import TexturePool
from models.tracking.state import NODES, Track
from models.tracking.track import follow
from tests.benchmarks.tracking_scoring import LEAST_VISIBLE, Identities

Curves = dict[int, np.ndarray]


class Tracker:
    """Ours."""

    def __init__(self) -> None:
        self.track = Track()
        self.seconds = 0.0

    def __call__(self, scene: Scene, image: np.ndarray) -> Curves:
        started = process_time()
        self.track = follow(self.track, scene, image)
        self.seconds += process_time() - started
        return {c.id: c.xy for c in self.track.cables if c.state != "lost"}


class FrameByFrame:
    """Baseline: every frame's instances take the ids of the last frame by least ``cost``; the rest are new."""

    def __init__(self, cost: Callable[[np.ndarray, np.ndarray], float], limit: float) -> None:
        self.cost, self.limit = cost, limit
        self.last: Curves = {}
        self.next = 1

    def __call__(self, scene: Scene, image: np.ndarray) -> Curves:
        lines = [i.centerline_xy for i in scene.instances]
        ids = list(self.last)
        costs = np.array([[self.cost(self.last[i], line) for line in lines] for i in ids]).reshape(len(ids), len(lines))
        rows, columns = linear_sum_assignment(costs)
        named = {int(j): ids[i] for i, j in zip(rows, columns, strict=True) if costs[i, j] < self.limit}
        now: Curves = {}
        for j, line in enumerate(lines):
            if j not in named:
                named[j] = self.next
                self.next += 1
            now[named[j]] = line
        self.last = now
        return now


def nearest(a: np.ndarray, b: np.ndarray) -> float:
    """Mean distance of nodes, the better way round."""
    p, q = resample(a, NODES), resample(b, NODES)
    return min(float(np.hypot(*(p - way).T).mean()) for way in (q, q[::-1]))


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """1 - IoU of the two curves drawn 9 px wide."""
    drawn = []
    for line in (a, b):
        mask = np.zeros((360, 640), np.uint8)
        cv2.polylines(mask, [np.rint(line).astype(np.int32)], False, 1, 9)
        drawn.append(mask > 0)
    either = np.count_nonzero(drawn[0] | drawn[1])
    return 1 - np.count_nonzero(drawn[0] & drawn[1]) / max(either, 1)


def measure_clip(seed: int, params: ClipParams) -> dict[str, dict[str, float]]:
    trackers = {"ours": Tracker(), "nearest": FrameByFrame(nearest, 60.0), "overlap": FrameByFrame(overlap, 0.999)}
    scores = {name: Identities(params.width_px) for name in trackers}
    places: dict[int, np.ndarray] = {}
    drift: list[float] = []
    after: list[bool] = []
    before: dict[int, int] = {}
    instances_s = 0.0
    for t, frame in enumerate(render_clip(np.random.default_rng([31, seed]), params, TexturePool(()))):
        image, mask = to_uint8(frame.rgb), frame.ids.numpy() > 0
        started = process_time()
        scene = extract(mask, image)
        instances_s += process_time() - started
        true = {
            k: c for k, (c, v) in enumerate(zip(frame.centerlines, frame.visible, strict=True)) if v > LEAST_VISIBLE
        }
        for name, tracker in trackers.items():
            found = scores[name].add(true, tracker(scene, image))
            if name == "ours":
                drift += _drift(frame, found, trackers["ours"].track, places, params)
                if t == params.covered[0] - 1:
                    before = found
                if t == params.covered[1] + 1:
                    after += [found.get(k) == number for k, number in before.items()]
    report = {n: {"idf1": s.idf1(), "switches": float(s.switches)} for n, s in scores.items()}
    report["ours"] |= {
        "drift_widths": float(np.mean(drift[-400:])) if drift else 0.0,
        "right_after_cover": float(np.mean(after)) if after else 1.0,
        "ms": 1e3 * trackers["ours"].seconds / params.frames,
        "instances_ms": 1e3 * instances_s / params.frames,
    }
    return report


def _drift(
    frame: Frame, found: dict[int, int], track: Track, places: dict[int, np.ndarray], params: ClipParams
) -> list[float]:
    """Widths by which the middle nodes have moved along their true cables since they were first seen."""
    cables = {cable.id: cable for cable in track.cables}
    out = []
    for k, number in found.items():
        line, nodes = frame.centerlines[k], cables[number].xy[NODES // 4 : -NODES // 4 : 4]
        lengths = arc_lengths(line)
        at = lengths[((line[None] - nodes[:, None]) ** 2).sum(2).argmin(1)] / lengths[-1]
        if number in places:
            out.append(float(np.abs(at - places[number]).mean() * lengths[-1] / params.width_px))
        elif cables[number].seen.all():
            places[number] = at
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clips", type=int, default=6)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    half = args.frames // 2
    sets = {
        "moving": ClipParams(frames=args.frames),
        "fast": ClipParams(frames=args.frames, speed=1.5),
        "covered": ClipParams(frames=args.frames, covered=(half, half + 30)),
    }
    report = {}
    for name, params in sets.items():
        clips = [measure_clip(seed, params) for seed in range(args.clips)]
        report[name] = {
            method: {key: round(float(np.mean([c[method][key] for c in clips])), 3) for key in clips[0][method]}
            for method in clips[0]
        }
        print(name, json.dumps(report[name]), flush=True)
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "tracking.json").write_text(
        json.dumps({"clips": args.clips, "frames": args.frames, "sets": report}, indent=1)
    )


if __name__ == "__main__":
    main()
