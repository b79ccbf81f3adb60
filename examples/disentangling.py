"""Take crossings out of a harness, one action after the other, on a simulated table.

The table holds strands as lines; an action turns the moved strand's part beyond the held place, as
two arms would.
"""

from __future__ import annotations

import argparse
import math

from dlo_client import Client, DisentangleAction, DisentangleRequest, Earlier
from PIL import Image, ImageDraw

SIZE = (640, 480)
WIDTH_PX = 12
Line = list[tuple[float, float]]


def main(arguments: list[str] | None = None) -> list[int]:
    """Crossings before the first action and after each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--actions", type=int, default=3)
    options = parser.parse_args(arguments)
    strands = tangled()
    counts: list[int] = []
    earlier: Earlier | None = None
    with Client(options.url) as client:
        for _ in range(options.actions + 1):
            request = DisentangleRequest(at_most=1, files=[], earlier=earlier)
            plan = client.run(request, mask=mask_of(strands))
            assert plan.topology is not None
            counts.append(len(plan.topology.crossings))
            print(f"{counts[-1]} crossings: {plan.message}")
            if plan.status not in ("planned", "unsure") or len(counts) > options.actions:
                break
            best = plan.actions[0]
            print(
                f"  hold {best.hold.xy}, turn {math.degrees(best.turn_rad):.0f} degrees: {best.why}"
            )
            turn(strands, best)
            earlier = Earlier.model_validate({"topology": plan.topology, "action": best})
    return counts


def tangled() -> list[Line]:
    """A trunk with three branches; the last one crosses the second."""
    return [
        along((60, 240), (300, 240)),
        along((300, 240), (560, 90)),
        along((300, 240), (570, 250)),
        along((300, 240), (360, 420)) + along((360, 420), (520, 180))[1:],
    ]


def along(start: tuple[float, float], end: tuple[float, float], count: int = 24) -> Line:
    return [
        (start[0] + (end[0] - start[0]) * k / count, start[1] + (end[1] - start[1]) * k / count)
        for k in range(count + 1)
    ]


def mask_of(strands: list[Line]) -> Image.Image:
    """White strands on black."""
    picture = Image.new("L", SIZE)
    draw = ImageDraw.Draw(picture)
    for strand in strands:
        draw.line(strand, fill=255, width=WIDTH_PX, joint="curve")
    return picture


def turn(strands: list[Line], action: DisentangleAction) -> None:
    """The part of the strand nearest to the pick that is beyond the held place turns about that
    place."""
    moved = min(
        strands, key=lambda strand: min(math.dist(point, action.pick.xy) for point in strand)
    )
    held = nearest(moved, action.hold.xy)
    picked = nearest(moved, action.pick.xy)
    part = range(held, len(moved)) if picked >= held else range(held + 1)
    cx, cy = moved[held]
    cos, sin = math.cos(action.turn_rad), math.sin(action.turn_rad)
    for k in part:
        x, y = moved[k][0] - cx, moved[k][1] - cy
        moved[k] = (cx + cos * x - sin * y, cy + sin * x + cos * y)


def nearest(line: Line, xy: tuple[float, float]) -> int:
    return min(range(len(line)), key=lambda k: math.dist(line[k], xy))


if __name__ == "__main__":
    main()
