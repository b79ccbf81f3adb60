"""What requests of several kinds have in common."""

from __future__ import annotations

from typing import Any

from hypothesis import strategies as st

from tests.properties.numbers import number

Request = dict[str, Any]


PICTURES = (
    "cable",
    "two",
    "branch",
    "thin",
    "thick",
    "ring",
    "black",
    "white",
    "noise",
    "dot",
    "row",
    "column",
    "checker",
    "alpha",
    "mask",
    "mask_two",
    "depth",
)


OF_ONE_SIZE = ("cable", "two", "branch", "thin", "thick", "ring", "noise", "alpha")


def picture(names: tuple[str, ...] = PICTURES) -> st.SearchStrategy[dict[str, str]]:
    return st.sampled_from(names).map(lambda name: {"picture": name})


def homography() -> st.SearchStrategy[list[list[float]]]:
    scale = number(0.002, 0.006)
    usual = st.tuples(
        scale,
        scale,
        number(-0.2, 0.2),
        number(-0.2, 0.2),
        st.sampled_from([1, 1, 1, -1, 1e-4, 1e6, 0]),
    )
    return usual.map(
        lambda t: [[t[0] * t[4], 0, t[2] * t[4]], [0, t[1] * t[4], t[3] * t[4]], [0, 0, t[4]]]
    )
