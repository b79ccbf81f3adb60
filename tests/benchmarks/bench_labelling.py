"""``dlo label`` against the bare pipeline, and killed with SIGKILL.

    python -m tests.benchmarks.bench_labelling [--pictures 1000] [--throughput 60]

Throughput: the same pictures through the stage alone, in one process with as many threads as the machine has cores,
and through the service with two workers; three times in turn, best of each. On a machine with busy neighbors two
processes get a larger share of it than one: there the processor seconds a picture are what counts.
Kills: ``dlo label`` on ``--pictures`` small pictures, killed ten times at random moments, then left to end; counted
are labels, jobs that the service has done, and pictures in the COCO file.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import psutil
from dlo_client import InstancesRequest
from dlo_client.contracts import ImageRef
from dlo_client.labelling import LabelOptions, LabelStore, find_pictures, label_pictures
from dlo_client.labelling.formats import WRITERS
from PIL import Image

from tests.system.test_labelling import SAMPLES, command, fill, labelled_jobs, run_killed
from workers import stages
from workers.settings import Settings

REPEATS = 3


@contextmanager
def service(folder: Path) -> Iterator[str]:
    arguments = [sys.executable, "-m", "services", "--port", "0", "--workers", "2", "--data-dir", str(folder)]
    environment = os.environ | {"DLO_LOG_LEVEL": "WARNING"}
    process = subprocess.Popen(arguments, env=environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout
    try:
        yield process.stdout.readline().split()[-1]
    finally:
        process.terminate()
        process.wait(timeout=30)


def photographs(folder: Path, count: int) -> None:
    """The samples at full size, each with a pixel of its own: no two have the same bytes."""
    folder.mkdir()
    for k in range(count):
        name = ("plain", "busy", "industrial")[k % 3]
        picture = Image.open(SAMPLES / f"{name}.jpg").convert("RGB")
        picture.paste((k % 256, k // 256, 0), (0, 0, 8, 8))
        picture.save(folder / f"{k:04d}.jpg", quality=92)


def bare(folder: Path, scratch: Path) -> tuple[float, float]:
    """Pictures a second through the stage alone, and processor seconds a picture."""
    tools = stages.warm(Settings(data_dir=scratch, workers=1))
    files = sorted(folder.iterdir())
    started, used = time.perf_counter(), time.process_time()
    for file in files:
        image = ImageRef(id=tools.blobs.put(file.read_bytes()))
        stages.run(InstancesRequest(image=image, files=[]), tools)
    return len(files) / (time.perf_counter() - started), (time.process_time() - used) / len(files)


def batch(address: str, folder: Path, out: Path) -> tuple[float, float]:
    """Pictures a second through the service, and processor seconds a picture of all processes together."""
    shutil.rmtree(out, ignore_errors=True)
    count = len(list(folder.iterdir()))
    started, used = time.perf_counter(), _used_by_all()
    label_pictures(find_pictures(folder), out, LabelOptions(at_once=8), url=address)
    return count / (time.perf_counter() - started), (_used_by_all() - used) / count


def _used_by_all() -> float:
    """Processor seconds of this process and all below it."""
    own = psutil.Process()
    return sum(sum(process.cpu_times()[:2]) for process in (own, *own.children(recursive=True)))


def throughput(scratch: Path, count: int) -> dict[str, Any]:
    photographs(scratch / "photographs", count)
    alone, together = [], []
    for k in range(REPEATS):
        alone.append(bare(scratch / "photographs", scratch / "bare"))
        # A service of its own each time: jobs that it knows already would be answered at once.
        with service(scratch / f"service{k}") as address:
            together.append(batch(address, scratch / "photographs", scratch / "labels"))
    return {
        "pictures": count,
        "bare_per_s": round(max(rate for rate, _ in alone), 2),
        "batch_per_s": round(max(rate for rate, _ in together), 2),
        "ratio_percent": round(100 * max(rate for rate, _ in together) / max(rate for rate, _ in alone), 1),
        "bare_cpu_s": round(min(used for _, used in alone), 3),
        "batch_cpu_s": round(min(used for _, used in together), 3),
        "cpu_ratio_percent": round(100 * min(used for _, used in alone) / min(used for _, used in together), 1),
    }


def killed(scratch: Path, count: int, kills: int = 10) -> dict[str, Any]:
    source, out, rng = scratch / "many", scratch / "many_labels", random.Random(3)
    fill(source, count)
    with service(scratch / "killed") as address:
        arguments = command(address, source, out)
        early = sum(run_killed(arguments, rng, (1.0, 5.0)) for _ in range(kills))
        subprocess.run(arguments, check=True, capture_output=True)
        jobs = labelled_jobs(address)
    with LabelStore(out) as store:
        names = [label.name for label in store.labels()]
        file = WRITERS["coco"](store.labels, out)
    images = json.loads(file.read_text())["images"]
    return {
        "pictures": count,
        "kills": kills,
        "ended_before_a_kill": early,
        "labelled": len(set(names)),
        "twice": len(names) - len(set(names)),
        "in_coco": len(images),
        "jobs_done_twice": len(jobs) - len(set(jobs)),
        "parts_left": len(list(out.rglob("*.part"))),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=int, default=1000)
    parser.add_argument("--throughput", type=int, default=60)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        result = {
            "throughput": throughput(Path(scratch), args.throughput),
            "killed": killed(Path(scratch), args.pictures),
        }
    print(json.dumps(result, indent=1))
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "labelling.json").write_text(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
