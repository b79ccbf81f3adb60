"""How many labelled pictures a second one core composes, and whether equal seeds give equal bytes.

``python -m tests.benchmarks.bench_synthesis [--count N] [--textures PACK]`` renders the same scenes
twice: the two passes are compared byte by byte. Time is processor time of this process; beside it
stands the time of the same pictures through OpenCV's JPEG encoder and decoder, for comparing
machines.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch

from models.synthesis.__main__ import truth_record
from models.synthesis.scenes import Labelled, SceneParams, render_scene, to_uint8
from models.synthesis.textures import load_pool

SIZES = {"320x192": (192, 320), "448x256": (256, 448), "640x360": (360, 640)}


def measure(
    size: tuple[int, int], count: int, textures: Path | None
) -> dict[str, float | bool | str]:
    """``count`` scenes of ``size`` (height, width), twice."""
    pool, params = load_pool(textures), SceneParams(size)
    scenes: list[Labelled] = []
    renders_ms, digests = [], []
    for _ in range(2):
        digest = hashlib.sha256()
        for k in range(count):
            spent, scene = timed(
                lambda k=k: render_scene(np.random.default_rng([0, k]), params, pool)
            )
            renders_ms.append(spent)
            digest.update(scene_bytes(scene))
            scenes.append(scene)
        digests.append(digest.hexdigest()[:12])
    jpegs_ms = [timed(lambda s=s: through_jpeg(to_uint8(s.rgb)))[0] for s in scenes]
    mean = statistics.mean(renders_ms)
    return {
        "images_per_second": round(1000 / mean, 1),
        "mean_ms": round(mean, 1),
        "p95_ms": round(statistics.quantiles(renders_ms, n=20)[-1], 1),
        "jpeg_round_trips": round(mean / statistics.mean(jpegs_ms), 1),
        "same_seed_same_bytes": digests[0] == digests[1],
        "sha256": digests[0],
    }


def scene_bytes(scene: Labelled) -> bytes:
    """Picture, ids and every other label."""
    truth = json.dumps(truth_record(scene, stride=1)).encode()
    return to_uint8(scene.rgb).tobytes() + scene.ids.cpu().numpy().tobytes() + truth


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time in ms, and what the work returned."""
    started = time.process_time()
    result = work()
    return 1000 * (time.process_time() - started), result


def through_jpeg(picture: np.ndarray) -> np.ndarray:
    return cv2.imdecode(cv2.imencode(".jpg", picture)[1], cv2.IMREAD_COLOR)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument(
        "--textures", type=Path, help="a pack or a folder; without it backgrounds are noise"
    )
    parser.add_argument("--out", type=Path, default=Path("build/bench/synthesis.json"))
    args = parser.parse_args()
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    rows = {name: measure(size, args.count, args.textures) for name, size in SIZES.items()}
    for name, row in rows.items():
        print(name, *(f"{key} {value}" for key, value in row.items()), sep="  ")
    args.out.parent.mkdir(parents=True, exist_ok=True)
    args.out.write_text(
        json.dumps({"scenes": args.count, "textures": args.textures is not None, "sizes": rows})
    )
    if not all(row["same_seed_same_bytes"] for row in rows.values()):
        raise SystemExit("equal seeds gave different bytes")


if __name__ == "__main__":
    main()
