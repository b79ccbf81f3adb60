"""From masks to graphs: skeletons with known joints, spurs, gaps; node density; what is too
complex."""

from __future__ import annotations

import numpy as np
import pytest

from models.strands.cleaning import clean
from models.strands.graph import cleaned, degrees, web_of
from models.strands.pixel_graph import trace
from models.topology.bridges import free_ends
from models.topology.encodings import EDGE_FEATURES, NODE_FEATURES, PATCH, encode
from models.topology.graph import TooComplexError, initialize, without
from tests.models.drawn_masks import circle, drawn

TEE = (np.array([[20, 120], [300, 120]]), np.array([[160, 120], [160, 220]]))


def traced(mask: np.ndarray):
    foreground = clean(mask, 0.2, 0.25)
    return cleaned(web_of(trace(foreground), foreground.distances))


def test_a_line_is_one_strand_of_its_length_and_width():
    mask = drawn(np.array([[40, 100], [240, 100]]), width=11)
    web = traced(mask)
    (strand,) = web.strands
    assert len(web.knots_xy) == 2
    assert strand.length == pytest.approx(200, abs=6)
    assert 2 * np.median(strand.radii) - 1 == pytest.approx(mask[:, 140].sum(), abs=1)
    assert np.abs(strand.xy[:, 1] - 100).max() < 1


def test_a_tee_has_one_joint_of_three_strands():
    web = traced(drawn(*TEE))
    joints = [k for k, n in degrees(web).items() if n == 3]
    assert len(web.strands) == 3
    assert len(joints) == 1
    assert np.hypot(*(web.knots_xy[joints[0]] - [160, 120])) < 4


def test_a_cross_of_two_skeleton_joints_becomes_one_of_four():
    web = traced(
        drawn(np.array([[60, 40], [260, 200]]), np.array([[60, 200], [260, 40]]), width=14)
    )
    assert sorted(degrees(web).values()) == [1, 1, 1, 1, 4]


def test_a_ring_has_a_strand_from_a_knot_to_itself():
    (strand,) = traced(drawn(circle((160, 120), 70))).strands
    assert strand.a == strand.b
    assert strand.length == pytest.approx(2 * np.pi * 70, rel=0.05)


def test_a_bump_makes_no_branch():
    mask = drawn(np.array([[20, 120], [300, 120]]), width=14)
    mask[105:113, 150:156] = True
    assert len(traced(mask).strands) == 1


def test_a_strand_that_leaves_the_picture_does_not_fork_at_the_border():
    """A skeleton cut off square forks into the two corners: two branch-points too many."""
    web = traced(drawn(np.array([[-20, 100], [340, 140]]), width=40))
    assert len(web.strands) == 1
    assert sorted(np.rint(web.knots_xy[:, 0]).tolist()) == pytest.approx([0, 319], abs=3)


def test_pinholes_and_specks_are_tidied_away():
    mask = drawn(np.array([[20, 120], [300, 120]]), width=15)
    mask[118:121, 100:103] = False
    mask[10:13, 10:13] = True
    tidy = clean(mask, 0.2, 0.25).mask
    assert tidy[119, 101]
    assert not tidy[11, 11]
    assert not mask[119, 101], "the mask that came in is left as it is"


def test_nodes_are_evenly_spaced_whatever_the_width():
    for width in (8, 12, 24):
        graph = initialize(drawn(np.array([[20, 120], [300, 120]]), width=width))
        steps = np.diff(np.sort(graph.xy[:, 0]))
        assert steps.max() - steps.min() < 1.5
        assert np.median(steps) == pytest.approx(graph.spacing, rel=0.2)


def test_edges_are_unique_pairs_and_know_which_are_traced():
    graph = initialize(drawn(*TEE))
    first, second = graph.edges
    assert (first < second).all()
    assert len(np.unique(first * len(graph.xy) + second)) == graph.edges.shape[1]
    assert graph.traced.sum() == sum(len(c) - 1 for c in graph.chains)


def test_encodings_have_their_shapes_and_do_not_move_with_the_picture():
    encoded = encode(initialize(drawn(*TEE)))
    count = len(encoded.nodes)
    assert encoded.patches.shape == (count, PATCH, PATCH)
    assert encoded.nodes.shape == (count, NODE_FEATURES)
    assert encoded.edge_features.shape == (encoded.edges.shape[1], EDGE_FEATURES)
    moved = encode(initialize(drawn(*(line - np.array([0, 8]) for line in TEE))))
    assert np.allclose(moved.nodes, encoded.nodes, atol=0.02)


def test_an_empty_mask_and_a_full_one_have_no_edges():
    for mask in (np.zeros((60, 80), bool), np.ones((60, 80), bool)):
        graph = initialize(mask)
        assert graph.edges.shape[0] == 2
        assert encode(graph).edge_features.shape[1] == EDGE_FEATURES


def test_noise_is_refused():
    with pytest.raises(TooComplexError):
        initialize(np.random.default_rng(0).random((400, 600)) > 0.5)


def test_nodes_are_bounded():
    lines = [np.array([[10, y], [1910, y]]) for y in range(10, 1070, 14)]
    graph = initialize(drawn(*lines, width=5, shape=(1080, 1920)))
    assert len(graph.xy) <= 2000


def test_without_its_branch_a_tee_is_one_strand_again():
    """Once the strand was joined from copies, and the pieces stayed beside it."""
    graph = initialize(drawn(*TEE))
    (branch,) = (k for k, s in enumerate(graph.web.strands) if s.xy[:, 1].max() > 180)
    left = without(graph, {branch})
    (strand,), (chain,) = left.web.strands, left.chains
    assert strand.length == pytest.approx(280, abs=12)
    assert np.all(np.diff(left.xy[chain][:, 0]) > 0) or np.all(np.diff(left.xy[chain][:, 0]) < 0)
    assert left.traced.sum() == len(chain) - 1
    assert len(free_ends(left)) == 2


def test_a_free_end_points_out_of_its_strand():
    mask = drawn(np.array([[40, 100], [240, 100]]), width=11)
    ends = free_ends(initialize(mask))
    assert sorted(round(float(e.heading[0])) for e in ends) == [-1, 1]
    assert all(e.width == pytest.approx(mask[:, 140].sum(), abs=1) for e in ends)
    assert all(abs(e.curvature) < 0.01 for e in ends)
