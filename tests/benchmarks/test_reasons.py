"""What the benchmark says of labels that are wrong in one known way."""

import numpy as np

from tests.benchmarks.reasons import why


def rows(*labels: tuple[int, int, int, int]) -> np.ndarray:
    """Labels of bands: (row, first column, last column, label), each 4 px high."""
    out = np.zeros((60, 100), np.uint8)
    for row, first, last, label in labels:
        out[row : row + 4, first:last] = label
    return out


TRUE = rows((10, 0, 100, 1), (30, 0, 100, 2))
MASK = TRUE > 0


def test_a_cable_in_two_pieces():
    found = rows((10, 0, 50, 1), (10, 50, 100, 2), (30, 0, 100, 3))
    assert why(found, TRUE, MASK) == "cable 1 in 2 pieces"


def test_two_cables_in_one():
    assert why(MASK.astype(np.uint8), TRUE, MASK) == "1 joins cables 1 and 2"


def test_something_that_is_none():
    found = TRUE + rows((50, 0, 30, 3))
    assert why(found, TRUE, MASK) == "3 is no cable"


def test_a_cable_that_is_not_found():
    found = rows((10, 0, 100, 1))
    assert why(found, TRUE, MASK) == "cable 2 not found, 100 % of it in the mask"
    assert why(found, TRUE, found > 0) == "cable 2 not found, 0 % of it in the mask"


def test_only_the_outlines_differ():
    thin = rows((10, 0, 100, 1), (30, 0, 100, 2))
    thin[13] = thin[33] = 0
    assert why(thin, TRUE, thin > 0) == "outlines: foreground IoU 75, 25 % of the cables unmasked"
    assert why(np.zeros_like(TRUE), np.zeros_like(TRUE), MASK & False).startswith("outlines")
