"""What a caller may hand over: checked once, at the door, with errors that name the argument."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray

MOST_PIXELS = 64_000_000
MASK_THRESHOLD = 0.5
_MOST_COORDINATE = 1e6


class ArgumentError(ValueError):
    """An argument that cannot be worked with; ``argument`` is its name."""

    def __init__(self, argument: str, message: str) -> None:
        super().__init__(f"{argument} {message}")
        self.argument = argument


def picture(value: ArrayLike, name: str) -> ByteArray:
    """``(H, W, 3)`` uint8 RGB."""
    array = _array(value, name)
    if array.ndim != 3 or array.shape[2] != 3:
        raise ArgumentError(
            name, f"has the shape {array.shape}; a picture is (height, width, 3), RGB"
        )
    if array.dtype != np.uint8:
        raise ArgumentError(name, f"is of {array.dtype}; a picture is of uint8, 0 to 255")
    _check_size(array, name)
    return np.ascontiguousarray(array)


def mask(value: ArrayLike, name: str, threshold: float | None = None) -> BoolArray:
    """``(H, W)`` bool. Integers: what is not 0 is foreground. Floats: probabilities of 0 to 1,
    foreground from ``threshold`` (0.5) on."""
    array = _array(value, name)
    if array.ndim != 2:
        raise ArgumentError(name, f"has the shape {array.shape}; a mask is (height, width)")
    _check_size(array, name)
    if array.dtype == np.bool_:
        return np.ascontiguousarray(array)
    if np.issubdtype(array.dtype, np.integer):
        return np.asarray(array != 0)
    probability = _finite(array, name)
    if probability.min() < 0 or probability.max() > 1:
        low, high = probability.min(), probability.max()
        raise ArgumentError(name, f"has values of {low:g} to {high:g}; probabilities are 0 to 1")
    limit = MASK_THRESHOLD if threshold is None else threshold
    return np.asarray((probability >= limit) & (probability > 0))


def depth(value: ArrayLike, name: str) -> Float32Array:
    """``(H, W)`` meters to the camera; 0 and NaN are unknown."""
    array = _array(value, name)
    if array.ndim != 2 or not np.issubdtype(array.dtype, np.floating):
        raise ArgumentError(
            name, f"is {array.shape} of {array.dtype}; depth is (height, width) floats, in meters"
        )
    return np.asarray(array, np.float32)


def points(value: ArrayLike, name: str, axes: int, least: int = 2) -> FloatArray:
    """``(n, axes)`` finite numbers, at least ``least`` points, not all of them the same."""
    array = _array(value, name)
    if array.ndim != 2 or array.shape[1] != axes:
        raise ArgumentError(name, f"has the shape {array.shape}; points are (n, {axes})")
    if len(array) < least:
        raise ArgumentError(name, f"has {len(array)} points; at least {least} are needed")
    line = _finite(array, name)
    if np.abs(line).max() > _MOST_COORDINATE:
        raise ArgumentError(name, f"has coordinates beyond ±{_MOST_COORDINATE:g}")
    if not np.ptp(line, axis=0).max() > 0:
        raise ArgumentError(name, "is a single point over and over; it has no length")
    return line


def number(value: float, name: str, low: float, high: float) -> float:
    """A finite number within ``low`` and ``high``."""
    if not isinstance(value, (int, float, np.number)) or not low <= float(value) <= high:
        raise ArgumentError(name, f"is {value!r}; it has to be {low:g} to {high:g}")
    return float(value)


def same_size(first: NDArray, second: NDArray, names: tuple[str, str]) -> None:
    """Both are of one height and width."""
    (h, w), (other_h, other_w) = first.shape[:2], second.shape[:2]
    if (h, w) != (other_h, other_w):
        raise ArgumentError(names[1], f"is {other_w} × {other_h} while the {names[0]} is {w} × {h}")


def _array(value: ArrayLike, name: str) -> NDArray:
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ArgumentError(name, f"is not an array: {error}") from None
    if not (np.issubdtype(array.dtype, np.number) or array.dtype == np.bool_):
        raise ArgumentError(name, f"is of {array.dtype}; an array of numbers is needed")
    if np.issubdtype(array.dtype, np.complexfloating):
        raise ArgumentError(name, "has complex numbers")
    return array


def _finite(array: NDArray, name: str) -> FloatArray:
    numbers = np.asarray(array, np.float64)
    if not np.isfinite(numbers).all():
        raise ArgumentError(name, "has values that are NaN or infinite")
    return numbers


def _check_size(array: NDArray, name: str) -> None:
    height, width = array.shape[:2]
    if not height or not width:
        raise ArgumentError(name, f"is empty: {width} × {height}")
    if height * width > MOST_PIXELS:
        raise ArgumentError(name, f"has {height * width} pixels; at most {MOST_PIXELS} are taken")
