"""Frames: moved, turned, renumbered, never mirrored; and back."""

from __future__ import annotations

import numpy as np
import pytest

from models.manipulation.frames import frames
from models.training.dynamics.data import nearly_straight

KINDS = ("principal", "edge")


def some(count: int = 20) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    return nearly_straight(rng, rng.uniform(0.2, 0.5, count)), rng.integers(0, 15, count)


@pytest.mark.parametrize("kind", KINDS)
def test_there_and_back(kind):
    states, edges = some()
    placed = frames(kind, states, edges)
    assert np.abs(placed.to_world(placed.to_frame(states)) - states).max() < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_a_frame_is_never_mirrored(kind):
    states, edges = some()
    assert np.linalg.det(frames(kind, states, edges).axes) == pytest.approx(np.ones(20))


@pytest.mark.parametrize("kind", KINDS)
def test_where_the_dlo_lies_and_which_end_is_first_do_not_matter(kind):
    states, edges = some()
    cos, sin = np.cos(2.5), np.sin(2.5)
    elsewhere = states @ np.array([[cos, sin], [-sin, cos]]) + [0.7, -0.4]
    reverse = states[:, ::-1]
    local = frames(kind, states, edges).to_frame(states)
    moved = frames(kind, elsewhere, edges).to_frame(elsewhere)
    turned_round = frames(kind, reverse, 14 - edges).to_frame(reverse)
    # A principal axis has two directions: the frame may be half a turn away, with the nodes the
    # other way round.
    half = -local[:, ::-1] if kind == "principal" else local
    for other in (moved, turned_round):
        same = np.abs(other - local).max((1, 2)) < 1e-9
        assert (same | (np.abs(other - half).max((1, 2)) < 1e-9)).all() or kind == "edge"
    if kind == "edge":
        middle = edges == 7
        assert np.abs(moved - local).max() < 1e-9
        assert np.abs(turned_round - local)[~middle].max() < 1e-9


def test_a_mirrored_state_is_another_state():
    states, edges = some()
    mirrored = states * [1, -1]
    local, other = (frames("edge", s, edges).to_frame(s) for s in (states, mirrored))
    assert np.abs(other - local).max() > 0.01
    assert np.abs(other - local * [1, -1]).max() < 1e-9


def test_the_gripped_edge_lies_at_the_origin_in_the_first_half():
    states, edges = some()
    placed = frames("edge", states, edges)
    local, own = placed.to_frame(states), placed.edges_to_frame(edges, 16)
    rows = np.arange(20)
    assert own.max() <= 7
    assert np.abs((local[rows, own] + local[rows, own + 1]) / 2).max() < 1e-12
    assert (local[rows, own + 1, 0] > local[rows, own, 0]).all()


def test_principal_nodes_run_from_left_to_right():
    states, edges = some()
    local = frames("principal", states, edges).to_frame(states)
    assert (local[:, -1, 0] > local[:, 0, 0]).all()
    assert np.abs(local.mean(1)).max() < 1e-12


def test_derivatives_go_to_the_world_like_points():
    states, edges = some(4)
    placed = frames("edge", states, edges)
    directions = np.random.default_rng(1).normal(size=(4, 16, 2, 3))
    for k in range(3):
        there = placed.to_world(placed.to_frame(states) + 1e-3 * directions[..., k])
        assert (
            np.abs((there - states) / 1e-3 - placed.jacobian_to_world(directions)[..., k]).max()
            < 1e-9
        )
