"""What depth shows where strands meet: a harness that branches, or a strand that lies upon another
one."""

from __future__ import annotations

import numpy as np
import pytest

from models.strands.graph import Strand, Web
from models.topology import order
from models.topology.classifiers import Classifiers
from models.topology.extraction import extract
from models.topology.heights import raised_odds
from models.topology.scene import Topology
from models.topology.sites import Arm
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


def seen(
    networks: tuple[Network, Classifiers],
    height_m: np.ndarray,
    noise_m: float = 0.0005,
    focal_px: float | None = None,
    mask: np.ndarray = MASK,
) -> Topology:
    """The topology of the mask with a table 0.6 m away on which the strands are so high."""
    noise = np.random.default_rng(3).normal(0, noise_m, mask.shape)
    return extract(
        mask,
        *networks,
        surfaces=[order.depth_map((0.6 - height_m + noise).astype(np.float32), focal_px)],
    )


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


def test_what_rises_by_less_than_half_a_thickness_is_no_strand_upon_another_one(networks):
    """10 px at 0.6 m are 15 mm with 400 px of focal length, 5 mm with 1200. A bundle that sagged
    was a crossing."""
    raised = bump(161, 120, 0.0055, 15)
    assert counts(seen(networks, raised, 0.0001, focal_px=1200)) == (2, 0, 1)
    assert counts(seen(networks, raised, 0.0001, focal_px=400)) == (3, 1, 0)


def strand(end: tuple[float, float]) -> Strand:
    """From a joint at (160, 120), 10 px wide."""
    xy = np.linspace((160.0, 120.0), end, 100)
    return Strand(0, 1, xy, np.full(100, 5.0))


def test_flat_depth_under_thick_strands_speaks_against_a_crossing():
    """Two branch-points near one another look like a crossing."""
    strands = tuple(strand(end) for end in ((80, 60), (240, 60), (80, 180), (240, 180)))
    web = Web(np.array([[160.0, 120.0]]), strands)
    arms = [Arm(k, 0, 0, s.xy[8], s.xy[9] - s.xy[8], 10.0) for k, s in enumerate(strands)]
    flat, raised = (0.6 - bump(160, 120, height, 15) for height in (0.0, 0.01))

    def odds(depth_m: np.ndarray, focal_px: float | None) -> float:
        return raised_odds([order.depth_map(depth_m.astype(np.float32), focal_px)], web, arms)

    assert odds(flat, 600) == pytest.approx(-3.0, abs=1.0)
    assert -1 < odds(flat, 6000) <= 0, "1 mm thick: the sensor hardly tells"
    assert odds(flat, None) == 0
    assert odds(raised, 600) == pytest.approx(3.0, abs=1.0)
