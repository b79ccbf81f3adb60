"""What the routes cannot say to OpenAPI by their types: problems, and bodies that FastAPI does not parse."""

from __future__ import annotations

import json
import re
from http import HTTPStatus
from typing import Any

from dlo_client.contracts import AnyJob
from fastapi import FastAPI
from pydantic import BaseModel

from services.examples import documented
from services.problems import MEDIA_TYPE
from workers.record import REQUEST

_SCHEMAS = "#/components/schemas/"
_PROBLEM = {MEDIA_TYPE: {"schema": {"$ref": f"{_SCHEMAS}Problem"}}}
_PICTURE = {"type": "string", "format": "binary"}

SUBMISSION: dict[str, Any] = {
    "required": True,
    "content": {
        "application/json": {"schema": {"$ref": f"{_SCHEMAS}AnyRequest"}, "examples": documented()},
        "multipart/form-data": {
            "schema": {
                "type": "object",
                "required": ["request"],
                "properties": {
                    "request": {
                        "$ref": f"{_SCHEMAS}AnyRequest",
                        "description": "The `kind` and what it takes; pictures may be left to the parts below",
                        "example": {"kind": "instances"},
                    },
                    "image": {
                        "type": "array",
                        "items": _PICTURE,
                        "description": "In order: what `{part: n}` counts, and what fills the images left out",
                    },
                    # An array, because documentation pages send an empty part for a file that nobody chose.
                    "mask": {
                        "type": "array",
                        "maxItems": 1,
                        "items": _PICTURE,
                        "description": "Fills the field `mask`",
                    },
                },
                "additionalProperties": False,
            },
            "encoding": {"request": {"contentType": "application/json"}},
        },
    },
}
"""Body of ``POST /v1/jobs``."""

PICTURE: dict[str, Any] = {
    "required": True,
    "description": "A PNG, JPEG, TIFF, WebP, BMP or GIF; which of them is told by the content.",
    "content": {
        "image/*": {"schema": _PICTURE},
        "application/octet-stream": {"schema": _PICTURE},
        "multipart/form-data": {
            "schema": {
                "type": "object",
                "required": ["file"],
                "properties": {"file": _PICTURE | {"description": "the picture"}},
                "additionalProperties": False,
            }
        },
    },
}
"""Body of ``POST /v1/images``."""


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The ``responses`` of a route that may answer with these problems, or with those that any route may."""
    return {
        status: {"description": HTTPStatus(status).phrase, "content": _PROBLEM}
        for status in sorted({*statuses, 401, 403, 421, 422, 429, 500, 503})
    }


def describe(app: FastAPI) -> None:
    """Add the schemas of the requests to the document that FastAPI makes of ``app``."""
    of_routes = app.openapi

    def document() -> dict[str, Any]:
        made: dict[str, Any] = json.loads(json.dumps(of_routes()).replace(_generic_name(AnyJob), "Job"))
        requests = REQUEST.json_schema(ref_template=_SCHEMAS + "{model}")
        made["components"]["schemas"] |= requests.pop("$defs") | {"AnyRequest": requests}
        return made

    app.openapi = document  # type: ignore[method-assign]


def _generic_name(model: type[BaseModel]) -> str:
    """What FastAPI calls a generic model: its parameters, spelled out."""
    return re.sub(r"[^\w.-]", "_", model.__name__, flags=re.ASCII)
