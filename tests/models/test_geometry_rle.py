"""COCO compressed run lengths: known strings, and every mask comes back."""

from __future__ import annotations

import numpy as np
import pytest

from models.geometry.rle import decode, encode, encode_labels


@pytest.mark.parametrize(
    ("mask", "counts"),
    [
        (np.zeros((2, 3), bool), "6"),  # one run of 6: chr(6 + 48)
        (np.ones((2, 3), bool), "06"),  # an empty background run first
        (np.array([[0, 1], [0, 1]], bool), "22"),
        (np.zeros((10, 10), bool), "T3"),  # 100 = 4 + 3 * 32: first group with the continuation bit
        (
            np.zeros((4, 4), bool),
            "`0",
        ),  # 16 needs a second group: its own top bit would read as a sign
        (
            np.array([[0, 1, 0, 0, 0, 1]], bool),
            "1130",
        ),  # the fourth run, 1, is stored less the second, 1
    ],
)
def test_known_strings(mask, counts):
    assert encode(mask) == counts
    np.testing.assert_array_equal(decode(counts, mask.shape), mask)


def test_negative_difference_is_twos_complement():
    """Runs 1 5 1 2: the fourth is stored as 2 - 5 = -3, five bits 11101 = 29."""
    mask = np.array([[0, 1, 1, 1, 1, 1, 0, 1, 1]], bool)
    assert encode(mask) == "151" + chr(29 + 48)
    np.testing.assert_array_equal(decode(encode(mask), mask.shape), mask)


@pytest.mark.parametrize("shape", [(1, 1), (7, 5), (40, 64), (3, 2000), (600, 4)])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_round_trip(shape, share):
    mask = np.random.default_rng(3).random(shape) < share
    np.testing.assert_array_equal(decode(encode(mask), shape), mask)


def test_long_runs_round_trip():
    mask = np.zeros((3000, 4000), bool)
    mask[100:2900, 50:3950] = True
    mask[5, 7] = True
    np.testing.assert_array_equal(decode(encode(mask), mask.shape), mask)


def test_labels_are_encoded_each_for_itself():
    labels = np.random.default_rng(4).integers(0, 4, (37, 53), dtype=np.uint8)
    strings = encode_labels(labels, 4)
    assert strings == [encode(labels == number) for number in (1, 2, 3, 4)]
    np.testing.assert_array_equal(decode(strings[1], labels.shape), labels == 2)


def test_empty_mask():
    assert encode(np.zeros((0, 5), bool)) == ""
    assert decode("", (0, 5)).shape == (0, 5)


@pytest.mark.parametrize(
    "counts", ["5", "T", "\x01", "~", "PPPPPPPPPPPPPPPPPPPPPPPP0", "~~~~~~~~~~~~~~~0"]
)
def test_broken_strings_are_refused(counts):
    with pytest.raises(ValueError, match="run"):
        decode(counts, (2, 3))
