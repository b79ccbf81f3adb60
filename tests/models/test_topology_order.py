"""Which strand lies on top, where the place of a crossing is some pixels off and at flat angles."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.polylines import arc_lengths
from models.topology.order import ordered, picture, points
from models.topology.scene import Crossing, Place
from tests.models.harnesses import section

LIFT_M = 0.006


def seen(upper: np.ndarray, lower: np.ndarray, away_px: float, hidden_px: float):
    """Points on two strands that cross at (200, 100): the upper one is lifted over ``away_px``, the
    lower one hidden within ``hidden_px``."""
    lines = []
    for line, lifted in ((upper, True), (lower, False)):
        away = np.hypot(*(line - (200, 100)).T)
        height = LIFT_M * np.exp(-((away / away_px) ** 2)) if lifted else np.zeros(len(line))
        keep = slice(None) if lifted else away > hidden_px
        lines.append((line[keep], 1 - height[keep]))
    return points(np.concatenate([xy for xy, _ in lines]), np.concatenate([d for _, d in lines]))


def crossing_of(strands, off_px: float) -> Crossing:
    """The crossing as it was walked: each place is ``off_px`` along its strand from where it is."""
    places = []
    for k, strand in enumerate(strands):
        lengths = arc_lengths(strand.xy)
        at = lengths[np.hypot(*(strand.xy - (200, 100)).T).argmin()]
        places.append(Place(k, float((at + off_px) / lengths[-1])))
    return Crossing((200.0, 100.0), places[0], places[1], 1.0, 0.5)


@pytest.mark.parametrize("off_px", [-7.0, 0.0, 7.0])
@pytest.mark.parametrize("upper", [0, 1])
def test_the_order_is_read_where_the_strands_meet(upper: int, off_px: float) -> None:
    """Seven pixels beside the crossing, the upper strand seemed to be the one that changes."""
    strands = [
        section([(100, 100), (300, 100)], width=6),
        section([(200, 20), (200, 180)], width=6),
    ]
    surface = seen(strands[upper].xy, strands[1 - upper].xy, 12, 4)
    found = ordered([crossing_of(strands, off_px)], strands, [surface])[0]
    assert found.over.section == upper
    assert found.order_score > 0.95


@pytest.mark.parametrize("upper", [0, 1])
def test_at_a_flat_angle_the_strand_that_comes_down_from_above_is_the_upper_one(upper: int) -> None:
    """Where outlines are one for long, what is seen there does not tell the strands apart."""
    strands = [section([(60, 72), (340, 128)], width=8), section([(60, 128), (340, 72)], width=8)]
    surface = seen(strands[upper].xy, strands[1 - upper].xy, 40, 22)
    found = ordered([crossing_of(strands, 0.0)], strands, [surface])[0]
    assert found.over.section == upper
    assert found.order_score > 0.9


def test_colors_are_compared_where_the_strands_meet() -> None:
    image = np.zeros((200, 400, 3), np.uint8)
    image[97:104, 100:300] = (200, 40, 40)
    image[20:180, 197:204] = (40, 40, 200)
    strands = [
        section([(100, 100), (300, 100)], width=6),
        section([(200, 20), (200, 180)], width=6),
    ]
    found = ordered([crossing_of(strands, 8.0)], strands, [picture(image)])[0]
    assert found.over.section == 1
    assert found.order_score > 0.95


def test_two_passes_of_one_strand_are_told_apart() -> None:
    loop = section(
        [(100, 100), (300, 100), (330, 60), (300, 20), (230, 20), (200, 60), (200, 180)], width=6
    )
    lengths = arc_lengths(loop.xy)
    passes = np.flatnonzero(np.hypot(*(loop.xy - (200, 100)).T) < 6)
    one, other = (Place(0, float(lengths[k] / lengths[-1])) for k in (passes[0], passes[-1]))
    half = int(np.flatnonzero(np.hypot(*(loop.xy - (330, 60)).T) < 6)[0])
    surface = seen(loop.xy[half:], loop.xy[:half], 12, 4)
    found = ordered([Crossing((200.0, 100.0), one, other, 1.0, 0.5)], [loop], [surface])[0]
    assert found.over.u == pytest.approx(other.u)
    assert found.order_score > 0.95
