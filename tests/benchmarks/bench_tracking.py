"""Which cable is which, over rendered clips: IDF1, switches, drift along the cable, time beside the
instances.

    python -m tests.benchmarks.bench_tracking [--clips N] [--frames N] [--set NAME] [--stress NAME] [--tuning]

Four cables of one look move slowly or fast, an arm covers 40 % of them for 30 frames, nothing is
seen for 10 frames, or they move as ropes in MuJoCo do (needs ``requirements/dynamics.in``). The
masks are true, the instances those of the default method. Baselines: the nearest curve, and the
largest overlap, frame by frame. Stress: the same cables faster, more of them covered, or longer out
of view. Labels: one labelled frame is propagated to the next 100. Without ``--set`` and
``--stress`` all of it is measured; with them only what they name. ``--tuning`` takes clips on which
constants may be chosen.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from models.geometry.polylines import arc_lengths, resample
from models.instances.scene import Scene
from models.tracking.state import NODES, Track, TrackedCable
from models.tracking.track import follow
from tests.benchmarks.clip_labels import propagated
from tests.benchmarks.tracking_clips import (
    REPORTED,
    STRESS,
    TUNING,
    ClipKind,
    Seen,
    clip,
    kinds,
    stress,
)
from tests.benchmarks.tracking_scoring import LEAST_VISIBLE, Identities, dense

Curves = dict[int, np.ndarray]
_HIGHER_IS_BETTER = "idf1", "right_after_cover"


class Tracker:
    """Ours."""

    def __init__(self) -> None:
        self.track = Track()
        self.seconds = 0.0

    def __call__(self, scene: Scene, image: np.ndarray, mask: np.ndarray) -> Curves:
        started = process_time()
        self.track = follow(self.track, scene, image, mask)
        self.seconds += process_time() - started
        found = {cable.id: dense(cable.xy, cable.seen) for cable in self.track.cables}
        return {number: points for number, points in found.items() if len(points)}


class FrameByFrame:
    """Baseline: every frame's instances take the ids of the last frame by least ``cost``; the rest
    are new."""

    def __init__(self, cost: Callable[[np.ndarray, np.ndarray], float], limit: float) -> None:
        self.cost, self.limit = cost, limit
        self.last: Curves = {}
        self.next = 1

    def __call__(self, scene: Scene, image: np.ndarray, mask: np.ndarray) -> Curves:
        lines = [i.centerline_xy for i in scene.instances]
        ids = list(self.last)
        costs = np.array([[self.cost(self.last[i], line) for line in lines] for i in ids]).reshape(
            len(ids), len(lines)
        )
        rows, columns = linear_sum_assignment(costs)
        named = {
            int(j): ids[i] for i, j in zip(rows, columns, strict=True) if costs[i, j] < self.limit
        }
        now: Curves = {}
        for j, line in enumerate(lines):
            if j not in named:
                named[j] = self.next
                self.next += 1
            now[named[j]] = line
        self.last = now
        return {number: dense(line) for number, line in now.items()}


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


def measure_clip(
    kind: ClipKind, seed: int, tuning: bool, baselines: bool = True
) -> dict[str, dict[str, float]]:
    ours, width = Tracker(), kind.params.width_px
    trackers: dict[str, Callable[[Scene, np.ndarray, np.ndarray], Curves]] = {"ours": ours}
    if baselines:
        trackers |= {
            "nearest": FrameByFrame(nearest, 60.0),
            "overlap": FrameByFrame(overlap, 0.999),
        }
    scores = {name: Identities(width) for name in trackers}
    event = kind.hidden if kind.hidden[1] else kind.params.covered
    drift, covered, instances_s = Drift(width), Cover(event), 0.0
    for t, frame in enumerate(clip(kind, seed, tuning)):
        image, mask = frame.image, frame.mask
        instances_s += frame.seconds
        true = {
            k: line[seen][::4]
            for k, (line, seen) in enumerate(zip(frame.centerlines, frame.in_view, strict=True))
            if seen.mean() > LEAST_VISIBLE
        }
        for name, tracker in trackers.items():
            found = scores[name].add(true, tracker(frame.scene, image, mask))
            if name == "ours":
                drift.add(frame, found, ours.track)
                covered.add(t, found)
    report = {n: {"idf1": s.idf1(), "switches": float(s.switches)} for n, s in scores.items()}
    report["ours"] |= {
        "drift_widths": drift.last(),
        "right_after_cover": covered.right(),
        "ms": 1e3 * ours.seconds / kind.params.frames,
        "instances_ms": 1e3 * instances_s / kind.params.frames,
    }
    return report


class Cover:
    """Share of the ids of the frame before the cover that are on the same cables soon after it."""

    def __init__(self, frames: tuple[int, int]) -> None:
        self._frames = frames
        self._before: dict[int, int] = {}
        self._right: list[bool] = []

    def add(self, t: int, found: dict[int, int]) -> None:
        if t == self._frames[0] - 1:
            self._before = found
        if t == self._frames[1] + 1:
            self._right = [found.get(k) == number for k, number in self._before.items()]

    def right(self) -> float:
        return float(np.mean(self._right)) if self._right else 1.0


class Drift:
    """Widths by which places of the same arc length have moved along the true cables since they
    were first seen."""

    def __init__(self, width_px: float) -> None:
        self._width_px = width_px
        self._places: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
        self._last: dict[tuple[int, int], float] = {}

    def add(self, frame: Seen, found: dict[int, int], track: Track) -> None:
        cables = {cable.id: cable for cable in track.cables}
        for k, number in found.items():
            cable, line = cables[number], frame.centerlines[k]
            if (k, number) not in self._places:
                if cable.seen.all():
                    wanted = cable.start_px + cable.length_px * np.linspace(0.25, 0.75, 7)
                    self._places[k, number] = wanted, _along(line, _at(cable, wanted)[0])
                continue
            wanted, before = self._places[k, number]
            xy, seen = _at(cable, wanted)
            if seen.any():
                moved = np.abs(_along(line, xy) - before)[seen]
                self._last[k, number] = float(moved.mean()) / self._width_px

    def last(self) -> float:
        """Mean over the cables of the last frame in which their places were seen."""
        return float(np.mean(list(self._last.values()))) if self._last else 0.0


def _at(cable: TrackedCable, wanted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) of the arc lengths ``wanted`` (n,), and which of them are in view."""
    node = (wanted - cable.start_px) / cable.length_px * (NODES - 1)
    xy = np.stack([np.interp(node, np.arange(NODES), axis) for axis in cable.xy.T], axis=1)
    inside = (node >= 0) & (node <= NODES - 1)
    return xy, inside & cable.seen[np.clip(np.rint(node), 0, NODES - 1).astype(int)]


def _along(line: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """Arc length (n,) of the points of ``line`` nearest to ``xy`` (n, 2)."""
    return arc_lengths(line)[((line[None] - xy[:, None]) ** 2).sum(2).argmin(1)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--clips", type=int, default=6, help="of each set, at most")
    parser.add_argument(
        "--labels", type=int, help="clips whose labels are propagated; 3 where all is measured"
    )
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--set", dest="sets", action="append", choices=tuple(kinds(1)))
    parser.add_argument("--stress", action="append", choices=tuple(STRESS))
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    whole = not (args.sets or args.stress)
    all_kinds, harder = kinds(args.frames), stress(args.frames)
    first = TUNING if args.tuning else REPORTED
    sets = {name: all_kinds[name] for name in (tuple(all_kinds) if whole else args.sets or ())}
    seeds = {name: [first, kind.number, min(kind.clips, args.clips)] for name, kind in sets.items()}
    found: dict[str, Any] = {
        "frames": args.frames,
        "tuning": args.tuning,
        "seeds": seeds,
        "sets": {},
        "stress": {},
    }
    for name, kind in sets.items():
        found["sets"][name] = _measured(kind, args.clips, args.tuning, True)
        print(name, json.dumps(found["sets"][name]), flush=True)
    for name in tuple(harder) if whole else args.stress or ():
        found["stress"][name] = {
            str(value): _measured(kind, args.clips, args.tuning, False)["ours"]
            for value, kind in harder[name].items()
        }
        print("stress", name, json.dumps(found["stress"][name]), flush=True)
    labelled = args.labels if args.labels is not None else 3 * whole
    found["labels"] = [
        propagated(all_kinds["moving"], seed, args.tuning) for seed in range(labelled)
    ]
    print("labels", json.dumps(found["labels"]), flush=True)
    _write(args.out, found)


def _measured(
    kind: ClipKind, most: int, tuning: bool, baselines: bool
) -> dict[str, dict[str, float]]:
    clips = [measure_clip(kind, seed, tuning, baselines) for seed in range(min(kind.clips, most))]
    return {method: _summary([c[method] for c in clips]) for method in clips[0]}


def _write(folder: Path, found: dict[str, Any]) -> None:
    """Sets that were not asked for stay as they were measured."""
    path = folder / "tracking.json"
    folder.mkdir(parents=True, exist_ok=True)
    before = json.loads(path.read_text()) if path.is_file() else {}
    if all(before.get(key) == found[key] for key in ("frames", "tuning")):
        found |= {key: before.get(key, {}) | found[key] for key in ("seeds", "sets", "stress")}
        found["labels"] = found["labels"] or before["labels"]
    path.write_text(json.dumps(found, indent=1))


def _summary(clips: list[dict[str, float]]) -> dict[str, float]:
    """By measure, the mean of all clips; with ``_sd`` the standard deviation between them, and the
    worst clip's."""
    out: dict[str, float] = {}
    for key in clips[0]:
        values = np.array([c[key] for c in clips])
        worst = values.min() if key in _HIGHER_IS_BETTER else values.max()
        out |= {key: values.mean(), f"{key}_sd": values.std(), f"{key}_worst": worst}
    return {key: round(float(value), 3) for key, value in out.items()}


if __name__ == "__main__":
    main()
