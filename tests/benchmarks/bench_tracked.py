"""DLO-WSL (thesis 2.5 and 2.7.3): the corrector on held-out crops, and labels of rendered multi-view scenes.

    python -m tests.benchmarks.bench_tracked [--scenes N]

The corrector's figures are those of its manifest entry (1000 crops of scenes that training never saw). A scene has 2
cables marked with 5 clicks each, 10 views, and errors of the hand, the tracker and the hand-eye calibration
(``tracked_scenes.Errors``). IoU: mean over true instances, then views, then scenes. Per click: that over the clicks.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from models.inference import Runtime, default_name, load
from models.labelling.correction import FIRST_SPREAD_PX, CorrectionParams, CropReader
from models.labelling.tracked import TrackedParams, label_tracked
from tests.benchmarks.scoring import score_labels
from tests.benchmarks.tracked_scenes import TrackedScene, tracked_scene

VARIANTS = {
    "strokes as drawn, smoothed": TrackedParams(correct=False),
    "thesis: every point by itself, thickness as given": TrackedParams(
        measured=0.0, correction=CorrectionParams(spread_px=(FIRST_SPREAD_PX,), agree=False)
    ),
    "corrections agree": TrackedParams(measured=0.0),
    "corrections agree, width measured": TrackedParams(),
}


def measure(scenes: int) -> dict[str, Any]:
    network = load(default_name("corrector"), Runtime(threads=1))
    made = [tracked_scene(seed) for seed in range(100, 100 + scenes)]
    rows = {name: [_iou(scene, network.run, params) for scene in made] for name, params in VARIANTS.items()}
    clicks = float(np.mean([scene.clicks for scene in made]))
    return {
        "corrector": dict(network.spec.metrics),
        "scenes": scenes,
        "clicks": clicks,
        "variants": {
            name: {
                "iou": round(100 * float(np.mean(values)), 1),
                "sd": round(100 * float(np.std(values)), 1),
                "worst": round(100 * float(np.min(values)), 1),
                "per_click": round(100 * float(np.mean(values)) / clicks, 2),
            }
            for name, values in rows.items()
        },
    }


def _iou(scene: TrackedScene, reader: CropReader, params: TrackedParams) -> float:
    given = (scene.images, scene.cameras, scene.strokes_m, scene.thickness_m)
    views = label_tracked(*given, reader, params)
    return float(np.mean([score_labels(v.ids, true)["iou"] for v, true in zip(views, scene.ids, strict=True)]))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=10)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    result = measure(args.scenes)
    print(json.dumps(result, indent=1))
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "tracked.json").write_text(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
