"""Simulated clicks on real photographs: how many a cable needs on the viewer's label bench.

    python -m tests.benchmarks.bench_clicks ../shared [--limit N] [--hand PX] [--rendered] [--weights JSON]

A person who sees the true cable (``clicking.py``) clicks its two ends; while the IoU of the drawn
cable is below 90 %, one more click or drag goes where the error is largest, 20 at most (counted as
20 where that is not enough). Pixels that belong to another cable (one that passes over) count
neither way. Beside it the same person in practice, before the cables that the service has found
(``corrected``): what is right is left, the rest is dragged to where it should be. What answers is
the page's own code; the probability is the one that the page gets: of the shipped network, settled.
All cables of the set count.

``ewd`` only measures. Weights are chosen with ``--rendered``: renders with labels that a hand could
have drawn (``drawn_labels.py``), on the even ones of them; the odd ones are stated apart.
``--weights '{"smooth": 2}'`` tries others than the page's own. Of the page's weights ``rim``,
``shade``, ``color`` and ``kinds`` were set on every third picture of ``ewd`` long ago, which is
stated apart too, and ``spread`` follows from errors along all its cables. Needs node.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray
from models.instances.scene import Scene
from models.library.perception import instances, segment
from tests.benchmarks import drawn_labels
from tests.benchmarks.clicking import Person

MOST = 20
GOAL = 0.90
KEPT = 0.7
"""A cable of the service that overlaps less with the true one is drawn anew."""
RENDERS = 80
"""Pictures of ``--rendered``, 188 cables."""
Labelled = Iterable[tuple[str, ByteArray, np.ndarray]]
"""Name, picture (H, W, 3) and labels (H, W): of each cable its number, negative where it is not
measured."""


class Page:
    """The viewer's modules in a node process."""

    def __init__(self) -> None:
        script = Path(__file__).with_name("clicks.mjs")
        self._process = subprocess.Popen(
            ["node", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def draw(self, request: dict[str, Any]) -> dict[str, Any]:
        """The outline as ``outlined`` gives it, and its ``mask`` (H, W)."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        drawn: dict[str, Any] = json.loads(self._process.stdout.readline())
        mask = np.zeros(request["height"] * request["width"], bool)
        mask[drawn["mask"]] = True
        return {**drawn, "mask": mask.reshape(request["height"], request["width"])}

    def close(self) -> None:
        assert self._process.stdin
        self._process.stdin.close()
        self._process.wait(timeout=10)


def overlap(drawn: BoolArray, mask: BoolArray, others: BoolArray) -> float:
    own = drawn & ~others
    return float((own & mask).sum() / max((own | mask).sum(), 1))


def needed(page: Page, request: dict[str, Any], person: Person) -> tuple[int, list[float]]:
    """Clicks and pulls until the goal, or :data:`MOST` + 1, and the IoU after each from the second
    on."""
    ious: list[float] = []
    while person.clicks and person.actions <= MOST:
        drawn = page.draw(
            {**request, "clicks": person.clicks, "pulls": person.pulls, "whole": person.whole}
        )
        person.goes_on(drawn)
        ious.append(round(overlap(drawn["mask"], person.mask, person.others), 3))
        if ious[-1] >= GOAL:
            return person.actions, ious
        if not person.act(drawn):
            break
    return MOST + 1, ious or [0.0]


def corrected(
    page: Page, request: dict[str, Any], person: Person, scene: Scene, anew: tuple[int, list[float]]
) -> tuple[int, list[float]]:
    """As :func:`needed`, beginning with the service's cable that overlaps most; 0 where that is
    right. Others that lie mostly on the true one are removed, an action each. ``anew`` is what it
    takes to draw it."""
    masks = [scene.labels == k + 1 for k in range(len(scene.instances))]
    ious = [overlap(mask, person.mask, person.others) for mask in masks]
    mostly = {k for k, mask in enumerate(masks) if (mask & person.mask).sum() > mask.sum() / 2}
    best = int(np.argmax(ious)) if ious else -1
    if best < 0 or ious[best] < KEPT:
        return min(anew[0] + len(mostly), MOST + 1), anew[1]
    removed = len(mostly - {best})
    item = scene.instances[best]
    given = {"centerline_xy": item.centerline_xy.tolist(), "width_px": item.width_px}
    drawn = {**page.draw({**request, "instance": given}), "mask": masks[best]}
    steps = [round(ious[best], 3)]
    person.corrects(drawn)
    while steps[-1] < GOAL:
        if person.actions + removed >= MOST or not person.act(drawn):
            return MOST + 1, steps
        wanted = {
            "clicks": person.clicks,
            "pulls": person.pulls,
            "moved": person.moved,
            "whole": person.whole,
        }
        drawn = page.draw({**request, **wanted})
        person.corrects(drawn)
        steps.append(round(overlap(drawn["mask"], person.mask, person.others), 3))
    return person.actions + removed, steps


def photographs(folder: Path) -> Iterator[tuple[str, ByteArray, np.ndarray]]:
    """Those of a set as in the folder ``ewd``."""
    for file in sorted((folder / "labels").rglob("*.png")):
        image = cv2.imread(str(next((folder / "imgs").rglob(f"{file.stem}.*"))))[:, :, ::-1]
        labels = cv2.imread(str(file), cv2.IMREAD_UNCHANGED)
        labels = labels if labels.ndim == 2 else labels.max(2)
        labels = cv2.resize(labels, image.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        yield file.stem, np.ascontiguousarray(image), labels


def measure(
    pictures: Labelled, *, every: int, hand_px: float = 0.0, weights: dict[str, float] | None = None
) -> dict[str, Any]:
    """Of all cables, and of those of pictures ``aside``: on every ``every``-th some of the weights
    were set."""
    rows: list[dict[str, Any]] = []
    page = Page()
    with tempfile.TemporaryDirectory() as scratch:
        for index, (name, image, labels) in enumerate(pictures):
            request = {**asked(Path(scratch) / name, image), "weights": weights or {}}
            scene = instances(image)
            for number in np.unique(labels[labels > 0]):
                mask = labels == number
                first, second = (
                    Person(
                        mask,
                        (labels != 0) & ~mask,
                        hand_px,
                        np.random.default_rng([index, int(number)]),
                    )
                    for _ in range(2)
                )
                clicked = needed(page, request, first)
                given = corrected(page, request, second, scene, clicked)
                row = {"picture": name, "cable": int(number), "tuned": index % every == 0}
                rows.append({**row, "clicked": clicked, "given": given})
                print(name, number, clicked[0], given[0], file=sys.stderr, flush=True)
    page.close()
    aside = [row for row in rows if not row["tuned"]]
    summaries = {
        f"{how}{part}": _summary([row[how] for row in some])
        for how in ("clicked", "given")
        for part, some in (("", rows), ("_aside", aside))
    }
    return {"cables": rows, "goal": GOAL, "most": MOST, "hand_px": hand_px, "summaries": summaries}


def asked(file: Path, image: ByteArray) -> dict[str, Any]:
    """What the page is asked about a picture; its bytes and its probability lie beside ``file``."""
    rgb, raw = file.with_suffix(".rgb"), file.with_suffix(".raw")
    rgb.write_bytes(image.tobytes())
    raw.write_bytes(np.rint(segment(image).probability * 255).astype(np.uint8).tobytes())
    return {"rgb": str(rgb), "map": str(raw), "width": image.shape[1], "height": image.shape[0]}


def _summary(ways: list[tuple[int, list[float]]]) -> dict[str, float]:
    """Of the actions that each cable took, and the IoU after each."""
    counts = np.array([count for count, _ in ways])
    never = counts > MOST
    capped = np.minimum(counts, MOST)
    return {
        "cables": len(ways),
        "mean": round(float(capped.mean()), 2),
        "median": float(np.median(capped)),
        "none_percent": round(100 * float((counts == 0).mean()), 1),
        "within_3_percent": round(100 * float((counts <= 3).mean()), 1),
        "within_6_percent": round(100 * float((counts <= 6).mean()), 1),
        "never_percent": round(100 * float(never.mean()), 1),
        "first_iou_percent": round(100 * float(np.mean([ious[0] for _, ious in ways])), 1),
        "best_iou_of_never": round(
            float(np.mean([max(ious) for count, ious in ways if count > MOST] or [0])), 3
        ),
    }


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("shared", type=Path)
    parser.add_argument("--limit", type=int, help="pictures")
    parser.add_argument("--out", type=Path, default=Path("build/bench"))
    parser.add_argument(
        "--hand", type=float, default=0.0, help="standard deviation of the hand, px"
    )
    parser.add_argument(
        "--rendered", action="store_true", help="renders with labels as a hand draws them, not ewd"
    )
    parser.add_argument(
        "--weights", type=json.loads, default={}, help="of the outline, others than the page's own"
    )
    args = parser.parse_args()
    renders = drawn_labels.pictures(args.limit or RENDERS)
    pictures = (
        renders if args.rendered else islice(photographs(args.shared / "data" / "ewd"), args.limit)
    )
    result = measure(
        pictures, every=2 if args.rendered else 3, hand_px=args.hand, weights=args.weights
    )
    print(json.dumps(result["summaries"], indent=1))
    args.out.mkdir(parents=True, exist_ok=True)
    shown = {
        "tried": args.weights,
        "clicks": True,
        "rendered": args.rendered,
        f"hand{args.hand:g}": args.hand,
    }
    (args.out / f"{'_'.join(part for part, given in shown.items() if given)}.json").write_text(
        json.dumps(result)
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
