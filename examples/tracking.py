"""Follow cables from picture to picture: each keeps the id that it got when it was first seen.

The pictures are one photograph that moves; give ``Track.frame`` those of a camera or a video
instead.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from dlo_client import Client
from PIL import Image

SAMPLE = Path(__file__).parent.parent / "tests" / "samples" / "plain.jpg"
GRAY = (128, 128, 128)


def main(arguments: list[str] | None = None) -> list[list[int]]:
    """Ids of the cables that are seen in each picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--frames", type=int, default=3)
    options = parser.parse_args(arguments)
    ids = []
    with Client(options.url) as client, client.track() as track, Image.open(SAMPLE) as picture:
        for number in range(options.frames):
            moved = picture.rotate(0, translate=(4 * number, 2 * number), fillcolor=GRAY)
            result = track.frame(moved, time_s=number / 10)
            ids.append(sorted(cable.id for cable in result.cables if cable.state != "lost"))
            print(
                f"picture {result.frame}: "
                + ", ".join(f"{cable.id} {cable.state}" for cable in result.cables)
            )
    return ids


if __name__ == "__main__":
    main()
