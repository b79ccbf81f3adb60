"""Masks of answers as arrays."""

from __future__ import annotations

import io

import numpy as np
import pytest
from dlo_client.arrays import run_lengths
from dlo_client.contracts import MaskRLE
from dlo_client.pictures import part_of

from models.geometry.rle import encode

DRAWN = np.array(
    [[0, 1, 1, 0], [0, 1, 0, 0], [1, 1, 0, 1]],
    dtype=bool,
)


def test_a_mask_of_an_answer_is_an_array() -> None:
    """There was no way from ``mask_rle`` to pixels without another package."""
    array = MaskRLE(size=(3, 4), counts=encode(DRAWN)).array()
    assert array.dtype == bool
    np.testing.assert_array_equal(array, DRAWN)


def test_runs_go_down_the_columns_background_first() -> None:
    assert run_lengths(encode(DRAWN)) == [2, 5, 4, 1]


@pytest.mark.parametrize("seed", range(20))
def test_every_mask_comes_back(seed: int) -> None:
    """Also long runs, whose differences need several groups and are negative."""
    random = np.random.default_rng(seed)
    height, width = random.integers(1, 200, 2)
    mask = random.random((height, width)) < random.choice([0.0, 0.002, 0.5, 0.998, 1.0])
    np.testing.assert_array_equal(MaskRLE(size=(height, width), counts=encode(mask)).array(), mask)


@pytest.mark.parametrize(
    ("size", "counts", "message"),
    [
        ((3, 4), encode(DRAWN[:2]), "do not make a mask of 3 x 4"),
        ((1, 1), "", "do not make a mask"),
        ((1, 1), "o", "cut short"),
        ((1, 1), "~", "not a compressed"),
        ((1, 1), "é", "not a compressed|do not make"),
    ],
    ids=["other size", "empty", "cut short", "foreign", "not ASCII"],
)
def test_runs_that_are_no_mask_are_refused(
    size: tuple[int, int], counts: str, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        MaskRLE(size=size, counts=counts).array()


def test_a_depth_of_points_travels_as_floats() -> None:
    points = np.random.default_rng(0).normal(size=(4, 5, 3))
    points[1, 2] = np.nan
    sent = np.load(io.BytesIO(part_of(points, "depth").data), allow_pickle=False)
    assert sent.dtype == np.float32
    np.testing.assert_allclose(sent, points, rtol=1e-6)
    for other in (points[..., 0] > 0, np.full((4, 5), 600, np.uint16)):
        assert part_of(other, "depth").data.startswith(b"\x89PNG")
    assert part_of(np.full((4, 5, 3), 0.5), "image").data.startswith(b"\x89PNG")
