"""Pydantic's errors in the names that the user wrote: ``params.neighbors``, without ``instances.``
before."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from dlo_client.contracts import FieldProblem

Error = Mapping[str, Any]
Step = str | int


class _Place(NamedTuple):
    """Where an error is: the user's own path, and the union and its member that pydantic tried
    there."""

    path: tuple[Step, ...]
    union: tuple[Step, ...] | None
    member: Step | None
    names: dict[str, Step]
    """The fields of what is there, by their names in lower case; empty for what is no object."""


def parameter_problems(errors: Iterable[Error]) -> list[FieldProblem]:
    """Problems of path, query and header parameters; the first step of a place states only which of
    these."""
    return [
        _problem(error, _Place(error["loc"][1:], None, None, {}), whole="request")
        for error in errors
    ]


def body_problems(errors: Iterable[Error], given: object, *, whole: str) -> list[FieldProblem]:
    """Problems of a JSON body.

    ``given`` is the parsed body: it separates the user's names from those of union members, which
    pydantic mixes into an error's place. Of a union's members only the nearest is reported: the one
    with the fewest errors, where what is missing counts twice: what is there names the member that
    was meant. ``whole`` names the body itself, for errors of no single field.
    """
    placed = [(error, _place(error, given)) for error in errors]
    counts: Counter[tuple[tuple[Step, ...] | None, Step | None]] = Counter()
    for error, place in placed:
        counts[place.union, place.member] += 2 if error["type"] == "missing" else 1
    fewest: dict[tuple[Step, ...] | None, int] = {}
    for (union, _), count in counts.items():
        fewest[union] = min(count, fewest.get(union, count))
    problems = [
        _problem(error, place, whole=whole)
        for error, place in placed
        if counts[place.union, place.member] == fewest[place.union]
    ]
    return list(dict.fromkeys(problems))


def _place(error: Error, given: object) -> _Place:
    """Follow the error's place through the body: a step that is not there is the name of a union's
    member.

    Except the first, the tag of the request's ``kind``, and the last of an error about a missing
    field.
    """
    steps = error["loc"]
    if steps and isinstance(given, dict) and steps[0] == given.get("kind"):
        steps = steps[1:]
    path: list[Step] = []
    union = member = None
    here: Any = given
    for index, step in enumerate(steps):
        if _is_there(step, here):
            here = here[step]
            path.append(step)
        elif error["type"] == "missing" and index == len(steps) - 1:
            path.append(step)
        elif union is None:
            union, member = tuple(path), step
    names = {str(name).lower(): name for name in here} if isinstance(here, dict) else {}
    return _Place(tuple(path), union, member, names)


def _is_there(step: Step, here: object) -> bool:
    if isinstance(here, list):
        return isinstance(step, int) and step < len(
            here
        )  # of a list of fixed length the end may be missing
    return isinstance(here, dict) and step in here


def _problem(error: Error, place: _Place, *, whole: str) -> FieldProblem:
    """One error as a field and a message.

    An error of a whole object (a rule between fields) names its field first in its message, in
    backticks.
    """
    path, message = place.path, error["msg"].removeprefix("Value error, ")
    match error["type"]:
        case "union_tag_not_found":
            path, message = (*path, _discriminator(error)), "Field required"
        case "union_tag_invalid":
            path = (*path, _discriminator(error))
            message = f"Should be one of {error['ctx']['expected_tags']}"
        case "model_type":
            message = "Input should be an object"
        case "value_error" if (named := re.match(r"`(\w+)`", message)) and (
            not path or place.names
        ):
            path = (*path, place.names.get(named[1].lower(), named[1]))
    return FieldProblem(field=".".join(map(str, path)) or whole, message=message)


def _discriminator(error: Error) -> str:
    name: str = error["ctx"]["discriminator"]
    return name.strip("'")
