"""Components: against SciPy's, and where there is nothing to join."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from models.geometry.components import components, runs


@pytest.mark.parametrize("seed", range(20))
def test_the_same_groups_as_by_a_sparse_matrix(seed: int) -> None:
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 60))
    pairs = rng.integers(0, count, (int(rng.integers(0, count + 5)), 2))
    table = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (count, count))
    expected = connected_components(table, directed=False)[1]
    assert components(pairs, count).tolist() == expected.tolist()


def test_a_long_chain_in_any_order_is_one() -> None:
    places = np.random.default_rng(0).permutation(5000)
    assert not components(np.stack((places[:-1], places[1:]), axis=1), 5000).any()


def test_nothing_and_no_pairs() -> None:
    none = np.zeros((0, 2), np.int64)
    assert len(components(none, 0)) == 0
    assert components(none, 3).tolist() == [0, 1, 2]


@pytest.mark.parametrize(
    ("flags", "expected"),
    [("", []), ("...", []), ("##", [(0, 2)]), ("#..##.#", [(0, 1), (3, 5), (6, 7)])],
)
def test_runs_of_true(flags, expected):
    assert runs(np.array([flag == "#" for flag in flags], dtype=bool)) == expected
