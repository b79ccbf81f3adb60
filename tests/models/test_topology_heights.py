"""What depth shows where strands meet: a harness that branches, or a strand that lies upon another one."""

from __future__ import annotations

import numpy as np
import pytest

from models.topology import order
from models.topology.classifiers import Classifiers
from models.topology.extraction import extract
from models.topology.scene import Topology
from models.weights.inference import Network
from tests.models.drawn_masks import drawn
from tests.models.harnesses import shipped

BAR = np.array([[0, 120], [319, 120]])
STEM = np.array([[200, 235], [160, 117]])
"""Ends 3 px beyond the middle of the bar: the outline is that of a branch."""
MASK = drawn(BAR, STEM, width=10)


@pytest.fixture(scope="module")
def networks() -> tuple[Network, Classifiers]:
    return shipped()


def seen(networks: tuple[Network, Classifiers], height_m: np.ndarray, noise_m: float = 0.0005) -> Topology:
    """The topology of the mask with a table 0.6 m away on which the strands are so high."""
    noise = np.random.default_rng(3).normal(0, noise_m, MASK.shape)
    return extract(MASK, *networks, surfaces=[order.depth_map((0.6 - height_m + noise).astype(np.float32))])


def bump(x: float, y: float, height_m: float, reach_px: float) -> np.ndarray:
    down, across = np.indices(MASK.shape)
    return height_m * np.exp(-(np.hypot(across - x, down - y) ** 2) / reach_px**2)


def counts(topology: Topology) -> tuple[int, int, int]:
    return len(topology.sections), len(topology.branch_points), len(topology.crossings)


def test_a_free_end_upon_another_strand_is_a_crossing(networks):
    topology = seen(networks, bump(161, 120, 0.006, 15))
    assert counts(topology) == (2, 0, 1)
    assert sorted("free" in s.ends for s in topology.sections) == [False, True]
    crossing = topology.crossings[0]
    places = {p.section: p.u for p in (crossing.over, crossing.under)}
    stem = next(k for k, s in enumerate(topology.sections) if "free" in s.ends)
    assert min(places[stem], 1 - places[stem]) < 0.15, "at its end"
    assert places[1 - stem] == pytest.approx(0.5, abs=0.05)
    assert np.hypot(*np.subtract(crossing.xy, (161, 120))) < 10


def test_what_is_as_high_as_what_it_comes_from_is_a_branch(networks):
    assert counts(seen(networks, np.zeros(MASK.shape))) == (3, 1, 0)


def test_a_thick_bundle_is_higher_than_its_branches_and_no_crossing(networks):
    height = np.where(np.indices(MASK.shape)[1] < 165, 0.012, 0.005)
    assert counts(seen(networks, height)) == (3, 1, 0)


def test_a_strand_that_rises_beside_a_branch_leaves_it_one(networks):
    """It goes over something farther on."""
    assert counts(seen(networks, bump(172, 150, 0.02, 35))) == (3, 1, 0)


def test_what_a_sensor_does_not_tell_apart_changes_nothing(networks):
    assert counts(seen(networks, bump(161, 120, 0.002, 15))) == (3, 1, 0)
    assert counts(seen(networks, np.full(MASK.shape, np.nan))) == (3, 1, 0)
