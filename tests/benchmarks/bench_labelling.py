"""``dlo label`` against the bare pipeline, and killed with SIGKILL.

    python -m tests.benchmarks.bench_labelling [--pictures 1000] [--throughput 60]

Throughput: new pictures go through the stage alone, in one process and one thread (to a label file
each), and through the service with two workers (of one thread each), in turn, five times; which of
the two is first changes. Rates depend on what else runs on the machine, and two workers get a
larger share of a busy one than one process does. So what is compared is the processor time a
picture: of the one process, and of all processes of the batch together (client, service, queue,
workers; their start is not in it). Neighbors that use the same caches can only add to it: the least
of the five runs counts, for either. Two workers that keep both cores busy deliver that share of
what the bare pipeline would with both. The rates of the same minutes stand beside it, with that of
one process whose network may use both cores, and the machine's load: on a machine without neighbors
they say what a user gets. Kills: ``dlo label`` on ``--pictures`` small pictures, killed ten times
at random moments, then left to end; counted are labels, jobs that the service has done, and
pictures in the COCO file. With ``--pictures 0`` only throughput is measured, and what an earlier
run says of kills is kept.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import psutil
from dlo_client import InstancesRequest
from dlo_client.contracts import ImageRef, InstancesResult
from dlo_client.labelling import LabelOptions, LabelStore, find_pictures, label_of, label_pictures
from dlo_client.labelling.formats import WRITERS
from dlo_client.labelling.store import write_whole
from PIL import Image

from tests.processes import running_service
from tests.system.test_labelling import SAMPLES, command, fill, labelled_jobs, run_killed
from workers import stages
from workers.settings import Settings
from workers.stages.outcome import Tools

REPEATS = 5


@dataclass(frozen=True)
class Cost:
    """Of one picture: seconds on the clock, and of all processors."""

    seconds: float
    cpu_s: float


def photographs(folder: Path, count: int, batch: int) -> list[Path]:
    """The samples at full size, each with pixels of its own: no two have the same bytes, in no two
    batches."""
    folder.mkdir()
    files = []
    for k in range(count):
        name = ("plain", "busy", "industrial")[k % 3]
        picture = Image.open(SAMPLES / f"{name}.jpg").convert("RGB")
        picture.paste((k % 256, 40 * batch, 0), (0, 0, 8, 8))
        files.append(folder / f"{k:04d}.jpg")
        picture.save(files[-1], quality=92)
    return files


def bare(files: Sequence[Path], tools: Tools) -> Cost:
    """Through the stage alone; a label file for each."""
    started, used = time.perf_counter(), time.process_time()
    for file in files:
        image = ImageRef(id=tools.blobs.put(file.read_bytes()))
        result = stages.run(InstancesRequest(image=image, files=[]), tools).result
        assert isinstance(result, InstancesResult)
        write_whole(
            file.with_suffix(".json"), label_of(result, file.name).model_dump_json().encode()
        )
    return Cost(
        (time.perf_counter() - started) / len(files), (time.process_time() - used) / len(files)
    )


def batch(address: str, files: Sequence[Path]) -> Cost:
    """Through the service."""
    folder = files[0].parent
    started, used = time.perf_counter(), _used_by_all()
    report = label_pictures(
        find_pictures(folder),
        folder.parent / f"{folder.name}_labels",
        LabelOptions(at_once=8),
        url=address,
    )
    cost = Cost((time.perf_counter() - started) / len(files), (_used_by_all() - used) / len(files))
    assert report.labelled == len(files), report.lines()
    return cost


def _used_by_all() -> float:
    """Processor seconds of this process and all below it."""
    own = psutil.Process()
    return sum(sum(process.cpu_times()[:2]) for process in (own, *own.children(recursive=True)))


def throughput(scratch: Path, count: int) -> dict[str, Any]:
    tools, both_cores = (
        stages.warm(Settings(data_dir=scratch / "bare", onnx_threads=k)) for k in (1, 2)
    )
    alone, wide, together, load = [], [], [], []
    with running_service(scratch / "service", workers=2) as address:
        batch(address, photographs(scratch / "warm", 8, 0))
        for k in range(1, REPEATS + 1):
            files = photographs(scratch / f"photographs{k}", count, k)
            turns = [
                lambda files=files: alone.append(bare(files, tools)),
                lambda files=files: wide.append(bare(files, both_cores)),
                lambda files=files: together.append(batch(address, files)),
            ]
            for turn in turns if k % 2 else turns[::-1]:
                turn()
            load.append(os.getloadavg()[0])
    best_alone, best_together = min(a.cpu_s for a in alone), min(b.cpu_s for b in together)
    return {
        "pictures": count,
        "repeats": REPEATS,
        "cpu_ratio_percent": round(100 * best_alone / best_together, 1),
        "bare_cpu_ms": [round(1000 * a.cpu_s, 1) for a in alone],
        "batch_cpu_ms": [round(1000 * b.cpu_s, 1) for b in together],
        "wall_ratio_percent": _rates(alone, together),
        "wall_ratio_both_cores_percent": _rates(wide, together),
        "bare_per_s": round(1 / median(a.seconds for a in alone), 2),
        "batch_per_s": round(1 / median(b.seconds for b in together), 2),
        "load": round(median(load), 1),
    }


def _rates(bare: Sequence[Cost], batch: Sequence[Cost]) -> float:
    """The batch's pictures a second, in percent of the bare pipeline's; the median of the runs."""
    return round(100 * median(a.seconds / b.seconds for a, b in zip(bare, batch, strict=True)), 1)


def killed(scratch: Path, count: int, kills: int = 10) -> dict[str, Any]:
    source, out, rng = scratch / "many", scratch / "many_labels", random.Random(3)
    fill(source, count)
    with running_service(scratch / "killed", workers=2) as address:
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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--pictures", type=int, default=1000)
    parser.add_argument("--throughput", type=int, default=60)
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    args = parser.parse_args()
    file = args.out / "labelling.json"
    result = json.loads(file.read_text()) if file.exists() else {}
    with tempfile.TemporaryDirectory() as scratch:
        result["throughput"] = throughput(Path(scratch), args.throughput)
        if args.pictures:
            result["killed"] = killed(Path(scratch), args.pictures)
    print(json.dumps(result, indent=1))
    args.out.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(result))
    return 0


if __name__ == "__main__":
    sys.exit(main())
