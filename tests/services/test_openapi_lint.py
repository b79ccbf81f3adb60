"""The OpenAPI document passes openapi-spec-validator, and states the unit of every quantity."""

from __future__ import annotations

import re

import pytest
from openapi_spec_validator import OpenAPIV31SpecValidator, validate

from services.examples import EXAMPLES

SUFFIXES = (
    "_px",
    "_m",
    "_m2",
    "_s",
    "_ms",
    "_rad",
    "_kg",
    "_xy",
    "_xy_m",
    "_mb",
    "_hz",
    "_bytes",
    "_widths",
    "_rle",
    "_uv",
)
UNIT = re.compile(
    r"\b(pixels?|px|meters?|mm|m|millimeters?|seconds?|s|ms|milliseconds|radians?|rad|degrees?|bytes?|kg|N m|N s|jobs"
    r"|share|percent|minutes|ratio|factor|times|probability|score|confidence|certainty|cost|loss|logarithms?|unit|units|id|ids|index"
    r"|indices|number|numbers|count|counts|how many|at most|polynomials|counted|edges?|nodes|points|hexadecimal"
    r"|version|parts?|knots|0 to 1|columns|rows|coefficients|0 for|run lengths|direction|status|attempts|from 1)\b",
    re.IGNORECASE,
)


@pytest.mark.slow
def test_the_document_is_valid(document):
    validate(document, cls=OpenAPIV31SpecValidator)


def _numeric(shape: dict) -> bool:
    """Whether the values, or those inside lists and alternatives, are numbers."""
    if shape.get("type") in ("number", "integer"):
        return True
    inner = [
        shape.get("items"),
        *shape.get("prefixItems", []),
        *shape.get("anyOf", []),
        *shape.get("oneOf", []),
    ]
    return any(_numeric(one) for one in inner if isinstance(one, dict))


def test_every_quantity_has_its_unit(document):
    """In the field's name, as ``width_px``, or in its description."""
    unitless = [
        f"{name}.{field}: {shape.get('description')}"
        for name, schema in document["components"]["schemas"].items()
        for field, shape in schema.get("properties", {}).items()
        if _numeric(shape)
        and not field.endswith(SUFFIXES)
        and not UNIT.search(shape.get("description", ""))
    ]
    assert unitless == []


def test_every_operation_is_named_and_told_apart(document):
    operations = [
        (path, method, operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    ]
    ids = [operation["operationId"] for *_, operation in operations]
    assert len(set(ids)) == len(ids)
    assert [(path, method) for path, method, one in operations if not one.get("summary")] == []
    assert [(path, method) for path, method, one in operations if not one.get("description")] == []
    assert [(path, method) for path, method, one in operations if not one.get("tags")] == []


def test_there_is_an_example_of_every_kind(document):
    kinds = set(document["components"]["schemas"]["AnyRequest"]["discriminator"]["mapping"])
    assert kinds == set(EXAMPLES)
    body = document["paths"]["/v1/recipes/{number}"]["put"]["requestBody"]["content"][
        "application/json"
    ]
    assert body["example"]["request"]["kind"] in kinds
