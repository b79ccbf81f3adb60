"""The planner's unit of length: one hand is what a gripper needs beside the strand that it closes
on.

In hands, a scene is the same whatever the picture's resolution, and so is the best action.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.arrays import FloatArray
from models.topology.scene import Topology

HAND_WIDTHS = 1.6
"""Widths of a typical strand that a hand needs where nobody gives the gripper's size: the mean of
the scenes that the network of moves has learned from."""


@dataclass(frozen=True)
class Frame:
    """The picture's ``width`` and ``height``, and how far outside it a piece may end, in hands."""

    width: float
    height: float
    margin: float = 0.0

    @classmethod
    def of(cls, topology: Topology, hand_px: float, margin_px: float) -> Frame:
        height, width = topology.size
        return cls(width / hand_px, height / hand_px, margin_px / hand_px)


def usual_hand_px(topology: Topology) -> float:
    """A hand for a topology in px: half of the length of its sections is no wider than the strand
    it is made for."""
    if not topology.sections:
        return 1.0
    widths, lengths = (
        np.array([getattr(s, name) for s in topology.sections]) for name in ("width", "length")
    )
    order = np.argsort(widths, kind="stable")
    up_to = np.cumsum(lengths[order])
    return HAND_WIDTHS * float(widths[order][np.searchsorted(up_to, up_to[-1] / 2)])


def in_hands(topology: Topology, hand_px: float) -> Topology:
    """The topology with lengths in hands; ``size`` remains that of the picture in px."""

    def point(xy: tuple[float, float]) -> tuple[float, float]:
        return xy[0] / hand_px, xy[1] / hand_px

    return replace(
        topology,
        sections=tuple(
            replace(s, xy=s.xy / hand_px, width=s.width / hand_px, length=s.length / hand_px)
            for s in topology.sections
        ),
        branch_points=tuple(replace(b, xy=point(b.xy)) for b in topology.branch_points),
        crossings=tuple(replace(c, xy=point(c.xy)) for c in topology.crossings),
        nodes_xy=topology.nodes_xy / hand_px,
    )


def allowance(width: float | FloatArray, widths: float, hands: float) -> FloatArray:
    """So many widths of a strand, and ``hands`` more for what a picture leaves uncertain: the
    threshold of a length."""
    return widths * np.asarray(width) + hands
