"""What every contract shares: numbers are finite, values do not change."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

_LONGEST_TEXT, _LONGEST_LIST = 80, 4
"""That ``repr`` writes out."""

PixelCoordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Point = tuple[PixelCoordinate, PixelCoordinate]
"""``(x, y)`` in pixels of the upright image; the center of the top-left pixel is ``(0, 0)``."""

Probability = Annotated[float, Field(ge=0.0, le=1.0)]


def _without_arrays(value: Any) -> Any:
    """Lists in place of an array, or of a list of arrays, which pydantic does not take for
    lists."""
    if hasattr(value, "tolist"):
        return value.tolist()
    if isinstance(value, list | tuple) and value and hasattr(value[0], "tolist"):
        return [_without_arrays(item) for item in value]
    return value


Numbers = BeforeValidator(_without_arrays)
"""Beside the type of a field that holds lists of numbers: a program may give a NumPy array for
them."""


class Contract(BaseModel):
    """Base of everything that travels between a client, the service and a worker. Unknown fields of
    a request are refused, so that a misspelled one is not silently without effect."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    def __repr_args__(self) -> Iterable[tuple[str | None, Any]]:
        """Long lists and texts as their length: a result can be megabytes. ``model_dump`` has all
        of it."""
        return [
            (name, _short(value)) for name, value in super().__repr_args__() if value is not None
        ]

    def __str__(self) -> str:
        return repr(self)


class _Count:
    """What stands for a long value in ``repr``."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        return self._text


def _short(value: Any) -> Any:
    if isinstance(value, str) and len(value) > _LONGEST_TEXT:
        return _Count(f"<{len(value)} characters>")
    if (
        isinstance(value, list | tuple)
        and value
        and (len(value) > _LONGEST_LIST or isinstance(value[0], BaseModel))
    ):
        what = type(value[0]).__name__ if isinstance(value[0], BaseModel) else "items"
        return _Count(f"<{len(value)} {what}>")
    if isinstance(value, dict) and len(value) > _LONGEST_LIST:
        return _Count(f"<{len(value)} entries>")
    return value


class Taken(Contract):
    """Base of the parts of a request that are found in answers too: the answer's own object fits,
    as JSON and as an object of the SDK. What it has beyond is passed over; so all fields that
    matter are required."""

    model_config = ConfigDict(extra="ignore", from_attributes=True)


class Reply(Contract):
    """Base of what the service answers: a client passes over fields that a newer service has
    added."""

    model_config = ConfigDict(extra="ignore")


ResultT = TypeVar("ResultT", bound=Reply)
