"""Labels as a hand draws them, on masks with known answers."""

from __future__ import annotations

import numpy as np
import pytest

from tests.benchmarks.drawn_labels import RIM_PX, Hand, labelled, pictures

STILL = Hand(shift=0.0, wider=0.0, waver=0.0, swell=0.0)


def bars() -> np.ndarray:
    """Two cables of ten pixels, three apart, and a stub."""
    ids = np.zeros((120, 200), np.int16)
    ids[40:50] = 1
    ids[53:63] = 2
    ids[100:110, 0:30] = 3
    return ids


def drawn(hand: Hand, seed: int = 0) -> np.ndarray:
    return labelled(bars(), np.random.default_rng(seed), hand)


def test_a_hand_that_never_errs_draws_what_is_there_and_pixels_that_are_cable_in_part() -> None:
    assert (np.abs(drawn(STILL)) == bars()).all(), (
        f"an edge between pixels is {RIM_PX} px further out"
    )


def test_a_stub_is_another_cable_but_is_not_measured() -> None:
    assert set(np.unique(drawn(STILL))) == {-3, 0, 1, 2}


def test_what_is_drawn_in_one_picture_is_off_alike() -> None:
    found = drawn(Hand(shift=2.0, wider=0.0, waver=0.0, swell=0.0), seed=4)
    rows = [np.nonzero(found[:, 100] == number)[0] for number in (1, 2)]
    off = [float(r.mean()) - middle for r, middle in zip(rows, (44.5, 57.5), strict=True)]
    assert abs(off[0]) >= 0.5
    assert off[0] == pytest.approx(off[1], abs=0.5)


def test_two_cables_that_both_get_wider_share_what_is_between_them() -> None:
    found = drawn(Hand(shift=0.0, wider=3.0, waver=0.0, swell=0.0), seed=1)
    assert set(np.unique(found[45:58, 100])) <= {0, 1, 2}
    assert (np.diff(found[:80, 100][found[:80, 100] > 0]) >= 0).all()


@pytest.mark.slow
def test_the_same_pictures_come_at_every_call() -> None:
    first, again = (next(iter(pictures(1))) for _ in range(2))
    assert first[0] == again[0]
    assert (first[1] == again[1]).all()
    assert (first[2] == again[2]).all()
    assert first[2].max() > 0
