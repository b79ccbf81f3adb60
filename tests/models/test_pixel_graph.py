"""Skeletons as graphs, on hand-drawn pixels."""

from __future__ import annotations

import numpy as np
import pytest

from models.strands.foreground import Foreground
from models.strands.pixel_graph import (
    FREE,
    doubled,
    halved,
    pixel_graph,
    skeleton_of,
    smoothed,
    trace,
)


def drawn(*rows: str) -> np.ndarray:
    return np.array([[c == "#" for c in row] for row in rows])


def chains(graph) -> list[list[list[int]]]:
    return [graph.xy[a:b].tolist() for a, b in zip(graph.bounds, graph.bounds[1:], strict=False)]


def test_a_line_is_one_chain_with_free_ends():
    graph = pixel_graph(drawn(".....", ".###.", "....#"))
    assert chains(graph) in ([[[1, 1], [2, 1], [3, 1], [4, 2]]], [[[4, 2], [3, 1], [2, 1], [1, 1]]])
    assert graph.ends.tolist() == [[FREE, FREE]]
    assert not graph.closed[0]


def test_a_corner_of_three_touching_pixels_is_no_junction():
    graph = pixel_graph(drawn("#..", "##.", ".##"))
    assert len(graph.junction_xy) == 0
    assert len(chains(graph)) == 1


def test_a_cross_has_one_junction_and_four_chains():
    graph = pixel_graph(drawn("..#..", "..#..", "#####", "..#..", "..#.."))
    assert graph.junction_xy.tolist() == [[2, 2]]
    assert len(graph.closed) == 4
    assert sorted(sorted(e) for e in graph.ends.tolist()) == [[FREE, 0]] * 4


def test_a_ring_is_closed_and_in_order():
    graph = pixel_graph(drawn(".###.", "#...#", "#...#", ".###."))
    (ring,) = chains(graph)
    assert graph.closed.tolist() == [True]
    assert len(ring) == 10
    around = np.array([*ring, ring[0]])
    assert np.abs(np.diff(around, axis=0)).max() == 1


def test_a_chain_of_one_pixel_between_two_junctions_knows_both():
    skeleton = drawn("#...#", ".#.#.", "..#..", "..#..", "..#..", ".#.#.", "#...#")
    graph = pixel_graph(skeleton)
    assert len(graph.junction_xy) == 2
    inner = [k for k, ends in enumerate(graph.ends.tolist()) if FREE not in ends]
    assert [sorted(graph.ends[k].tolist()) for k in inner] == [[0, 1]]


@pytest.mark.parametrize("shape", [(0, 7), (1, 1), (1, 200), (60, 60)])
def test_nothing_gives_nothing(shape):
    graph = pixel_graph(skeleton_of(np.zeros(shape, bool)))
    assert len(graph.xy) == 0
    assert graph.ends.shape == (0, 2)


def test_a_strand_that_leaves_the_picture_has_no_fork_at_the_border():
    mask = np.zeros((60, 100), bool)
    mask[25:36] = True
    graph = trace(Foreground.of(mask))
    assert len(graph.closed) == 1
    assert sorted(graph.xy[[0, -1], 0].tolist()) == [0, 99]


def test_halved_keeps_gaps_and_doubled_is_dense_again():
    mask = np.zeros((40, 80), bool)
    mask[4:16], mask[17:30] = True, True
    small = halved(mask)
    assert small.shape == (20, 40)
    assert not small[8].any()  # the one-pixel gap is still there
    graph = doubled(pixel_graph(skeleton_of(small)))
    assert len(graph.closed) == 2
    for points in chains(graph):
        assert np.abs(np.diff(points, axis=0)).max() == 1
        assert abs(np.mean(points, axis=0)[1] - (9 if points[0][1] < 16 else 23)) < 2


def test_smoothing_stays_within_a_chain_and_keeps_its_ends():
    points = np.array([[0, 0], [1, 1], [2, 0], [100, 7], [101, 8], [102, 7]])
    out = smoothed(points, np.array([0, 3, 6]))
    np.testing.assert_allclose(out[[0, 2, 3, 5]], points[[0, 2, 3, 5]])
    np.testing.assert_allclose(out[1], [1, 1 / 3])
