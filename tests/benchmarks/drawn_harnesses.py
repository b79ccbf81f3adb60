"""The drawing of a harness as its maker would have it, for the rendered scenes."""

from __future__ import annotations

import numpy as np

from models.synthesis.harness import FREE, Harness
from models.topology.harness_drawing import Drawn


def drawing_of(harness: Harness, mm_per_px: float) -> list[Drawn]:
    """What a designer would draw of it, in millimeters."""

    def point(k: int, end: int, branch: int) -> str:
        return f"B{branch}" if branch != FREE else f"E{k}.{end}"

    return [
        Drawn(
            str(k),
            point(k, 0, s.ends[0]),
            point(k, 1, s.ends[1]),
            3.0 * (len(s.xy) - 1) * mm_per_px,
        )
        for k, s in enumerate(harness.sections)
    ]


def nearest_branch(harness: Harness, xy: np.ndarray) -> int:
    away = [
        np.hypot(*(s.xy[:, None] - xy[None]).transpose(2, 0, 1)).min(axis=0)
        for s in harness.sections
    ]
    return int(np.bincount(np.argmin(away, axis=0)).argmax())
