"""What the files of a result cost on a large picture: a default request against ``files: []``.

    python -m tests.benchmarks.bench_large [--rounds 11]

The bundled photograph enlarged to 12 megapixels, both requests in turn in this process; processor
seconds.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from io import BytesIO
from pathlib import Path

import numpy as np
from dlo_client.contracts import ImageRef, InstancesRequest
from PIL import Image

from workers import stages
from workers.settings import Settings

PICTURE = Path(__file__).parents[1] / "samples" / "industrial.jpg"
SIZE = (4000, 3000)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=11)
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as folder:
        spent = _spent(Path(folder), rounds)
    row = {
        "rounds": rounds,
        "default_s": round(float(np.median(spent[:, 0])), 3),
        "no_files_s": round(float(np.median(spent[:, 1])), 3),
        "ratio": round(float(np.median(spent[:, 0] / spent[:, 1])), 3),
    }
    print(json.dumps(row))
    Path("build/bench").mkdir(parents=True, exist_ok=True)
    Path("build/bench/large.json").write_text(json.dumps(row))


def _spent(folder: Path, rounds: int) -> np.ndarray:
    """(rounds, 2) processor seconds of the default request and of ``files: []``; a first round is
    left out."""
    tools = stages.warm(Settings(data_dir=folder, onnx_threads=1))
    data = BytesIO()
    Image.open(PICTURE).resize(SIZE, Image.Resampling.BICUBIC).save(data, "JPEG", quality=92)
    image = ImageRef(id=tools.blobs.put(data.getvalue()))
    spent = np.zeros((rounds + 1, 2))
    for row in spent:
        for column, request in enumerate(
            (InstancesRequest(image=image), InstancesRequest(image=image, files=[]))
        ):
            start = time.process_time()
            stages.run(request, tools)
            row[column] = time.process_time() - start
    return spent[1:]


if __name__ == "__main__":
    main()
