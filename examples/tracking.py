"""Follow cables from picture to picture by their ids: each keeps the number it got when it was first seen.

A cable of the next picture is the one whose centerline it is nearest to; what moved farther than its own width is new.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from dlo_client import Client, Instance, InstancesRequest
from PIL import Image

SAMPLE = Path(__file__).parent.parent / "tests" / "samples" / "plain.jpg"
NODES = 16


def main(arguments: list[str] | None = None) -> list[list[int]]:
    """Ids of the cables in each picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--frames", type=int, default=3)
    options = parser.parse_args(arguments)
    known: dict[int, list[tuple[float, float]]] = {}
    ids = []
    with Client(options.url) as client, Image.open(SAMPLE) as picture:
        for number in range(options.frames):
            moved = picture.rotate(0, translate=(4 * number, 2 * number), fillcolor=(128, 128, 128))
            result = client.run(InstancesRequest(points_per_instance=NODES, files=[]), moved)
            known = followed(known, result.instances)
            ids.append(sorted(known))
            print(f"picture {number + 1}: cables {ids[-1]}")
    return ids


def followed(known: dict[int, list[tuple[float, float]]], seen: list[Instance]) -> dict[int, list[tuple[float, float]]]:
    """Centerlines by id, of the cables that are seen now."""
    now: dict[int, list[tuple[float, float]]] = {}
    fresh = max(known, default=0)
    for cable in sorted(seen, key=lambda one: -one.length_px):
        free = {number: line for number, line in known.items() if number not in now}
        best = min(free, key=lambda number: apart(free[number], cable.centerline_xy), default=None)
        if best is None or apart(free[best], cable.centerline_xy) > 2 * cable.width_px:
            fresh += 1
            best = fresh
        now[best] = cable.centerline_xy
    return now


def apart(line: list[tuple[float, float]], other: list[tuple[float, float]]) -> float:
    """Median distance of the points of ``other`` to the nearest of ``line``, pixels."""
    nearest = sorted(min(math.dist(point, place) for place in line) for point in other)
    return nearest[len(nearest) // 2]


if __name__ == "__main__":
    main()
