"""Simulated clicks on real photographs: how many a cable needs with the viewer's snapping line (``livewire.js``).

    python -m tests.benchmarks.bench_clicks ../shared [--limit N]

A person who sees the true cable clicks its two ends; while the IoU of the drawn cable is below 90 %, one more click
goes where the line is farthest from the true centerline. Pixels that belong to another cable (one that passes over)
count neither way. Masks follow the contour of the probability; a plain stroke costs one click more, on the box that
turns this off. The probability is that of the shipped network on the photograph. Needs node.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from models.inference import default_name, load
from models.segmentation.segment import ForegroundInput, segment

MOST = 20
GOAL = 0.90
_SHORTEST_PX = 40


class LiveWire:
    """The viewer's module in a node process."""

    def __init__(self) -> None:
        script = Path(__file__).with_name("clicks.mjs")
        self._process = subprocess.Popen(["node", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def trace(self, request: dict[str, Any]) -> tuple[np.ndarray, list[np.ndarray]]:
        """Line (n, 2), and the masks along the contour and as a stroke."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        found = json.loads(self._process.stdout.readline())
        masks = [np.zeros(request["height"] * request["width"], bool) for _ in found["masks"]]
        for mask, pixels in zip(masks, found["masks"], strict=True):
            mask[pixels] = True
        return np.array(found["line"]), [mask.reshape(request["height"], request["width"]) for mask in masks]

    def close(self) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait(timeout=10)


def true_line(mask: np.ndarray) -> np.ndarray | None:
    """(n, 2) pixels from end to end along the skeleton, over the gaps where other cables pass; None if it is short."""
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((25, 25), np.uint8))
    y, x = np.nonzero(skeletonize(closed > 0))
    if len(x) < _SHORTEST_PX:
        return None
    points = np.stack([x, y], 1)
    pairs = cKDTree(points).query_pairs(1.5, output_type="ndarray")
    length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    graph = coo_matrix((length, pairs.T), shape=(len(x), len(x))).tocsr()
    first = int(np.argmax(_finite(dijkstra(graph, directed=False, indices=0))))
    reached, before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
    path = [int(np.argmax(_finite(reached)))]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return points[path] if len(path) >= _SHORTEST_PX else None


def _finite(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, -1)


def overlap(drawn: np.ndarray, mask: np.ndarray, others: np.ndarray) -> float:
    own = drawn & ~others
    return float((own & mask).sum() / max((own | mask).sum(), 1))


def clicks_needed(wire: LiveWire, request: dict[str, Any], mask: np.ndarray, others: np.ndarray) -> tuple[int, float]:
    """Clicks until the goal, or :data:`MOST` + 1, and the IoU then."""
    true = true_line(mask)
    assert true is not None
    at = [0, len(true) - 1]
    iou = 0.0
    while len(at) <= MOST:
        # Clicks that correct a line which is off are exact (with Shift); the first ones snap.
        clicks = [[*true[i].tolist(), i in at[2:]] for i in sorted(at)]
        line, masks = wire.trace({**request, "clicks": clicks})
        along, stroke = (overlap(drawn, mask, others) for drawn in masks)
        iou = max(iou, along, stroke)
        if iou >= GOAL:
            return len(at) + (along < GOAL), iou
        away = cKDTree(line).query(true)[0]
        away[[*at]] = 0
        at.append(int(np.argmax(away)))
    return MOST + 1, iou


def measure(shared: Path, limit: int | None) -> dict[str, Any]:
    network = load(default_name("foreground"))
    settings = ForegroundInput.from_manifest(network.spec.preprocess)
    folder = shared / "data" / "ewd"
    rows: list[dict[str, Any]] = []
    wire = LiveWire()
    with tempfile.TemporaryDirectory() as scratch:
        for file in sorted((folder / "labels").rglob("*.png"))[:limit]:
            image_file = next((folder / "imgs").rglob(f"{file.stem}.*"))
            image = cv2.imread(str(image_file))[:, :, ::-1]
            labels = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
            labels = labels if labels.ndim == 2 else labels.max(2)
            labels = cv2.resize(labels, image.shape[1::-1], interpolation=cv2.INTER_NEAREST)
            raw = Path(scratch) / f"{file.stem}.raw"
            probability = segment(np.ascontiguousarray(image), network, settings)
            raw.write_bytes(np.rint(probability * 255).astype(np.uint8).tobytes())
            request = {"map": str(raw), "width": image.shape[1], "height": image.shape[0]}
            for number in np.unique(labels[labels > 0]):
                mask = labels == number
                if true_line(mask) is not None:
                    count, iou = clicks_needed(wire, request, mask, (labels > 0) & ~mask)
                    rows.append({"picture": file.stem, "cable": int(number), "clicks": count, "iou": round(iou, 3)})
    wire.close()
    return {"cables": rows, "goal": GOAL, "most": MOST, "summary": _summary(rows)}


def _summary(rows: list[dict[str, Any]]) -> dict[str, float]:
    clicks = np.array([row["clicks"] for row in rows])
    within = clicks <= MOST
    return {
        "cables": len(rows),
        "mean": round(float(clicks.mean()), 2),
        "median": float(np.median(clicks)),
        "within_3_percent": round(100 * float((clicks <= 3).mean()), 1),
        "within_6_percent": round(100 * float((clicks <= 6).mean()), 1),
        "never_percent": round(100 * float((~within).mean()), 1),
        "mean_of_reached": round(float(clicks[within].mean()), 2) if within.any() else 0.0,
        "best_iou_of_never": round(float(np.mean([r["iou"] for r in rows if r["clicks"] > MOST] or [0])), 3),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--limit", type=int)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    result = measure(args.shared, args.limit)
    print(json.dumps(result["summary"], indent=1))
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "clicks.json").write_text(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
