"""A camera before a table: every picture's cables, one line a picture.

    python examples/camera_loop.py --device 0            # a camera, by OpenCV
    python examples/camera_loop.py --frames 3            # without one: a bundled picture, again and again

Pictures of OpenCV are in the order B, G, R; ``opencv`` turns them.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from dlo_client import Client, InstancesRequest, opencv

SAMPLE = Path(__file__).parent.parent / "tests" / "samples" / "plain.jpg"


def main(arguments: list[str] | None = None) -> list[int]:
    """How many cables each picture had."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--device", type=int)
    parser.add_argument("--frames", type=int, default=0, help="0: until Ctrl-C")
    options = parser.parse_args(arguments)
    counts = []
    with Client(options.url) as client:
        for picture in frames(options.device, options.frames):
            began = time.monotonic()
            result = client.run(InstancesRequest(files=[], effort="fast"), picture)
            took_ms = 1000 * (time.monotonic() - began)
            unsure = ", look at it" if result.status.code == "unsure" else ""
            print(
                f"{len(result.instances)} cables, {len(result.crossings)} crossings in {took_ms:.0f} ms{unsure}"
            )
            counts.append(len(result.instances))
    return counts


def frames(device: int | None, count: int) -> Iterator[Any]:
    """Pictures of the camera, or the bundled one."""
    number = 0
    if device is None:
        while not count or number < count:
            number += 1
            yield SAMPLE
        return
    import cv2

    camera = cv2.VideoCapture(device)
    while not count or number < count:
        taken, picture = camera.read()
        if not taken:
            raise SystemExit(f"camera {device} gives no picture")
        number += 1
        yield opencv(picture)


if __name__ == "__main__":
    main()
