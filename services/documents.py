"""What the routes cannot say to OpenAPI by their types: problems, and bodies that FastAPI does not
parse."""

from __future__ import annotations

import json
import re
from http import HTTPStatus
from typing import Any

from dlo_client.contracts import AnyJob
from dlo_client.contracts.recipes import CameraBody, RecipeBody, RunInput
from fastapi import FastAPI
from pydantic import BaseModel

from services.examples import CAMERA, RECIPE, documented
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
                    # An array, because documentation pages send an empty part for a file that
                    # nobody chose.
                    "mask": {
                        "type": "array",
                        "maxItems": 1,
                        "items": _PICTURE,
                        "description": "Fills the field `mask`",
                    },
                    "depth": {
                        "type": "array",
                        "maxItems": 1,
                        "items": _PICTURE,
                        "description": "Fills the field `depth`; may be a point cloud",
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

NETWORK: dict[str, Any] = {
    "required": True,
    "description": "The file of a network, as `GET /v1/models/{name}/file` gives it",
    "content": {"application/octet-stream": {"schema": _PICTURE}},
}
"""Body of ``POST /v1/models``."""

LABELS: dict[str, Any] = {
    "required": True,
    "description": "A ZIP archive of `NAME.jpg` or `NAME.png`, and `NAME_ids.png` beside it: 0 background, else cable",
    "content": {
        "application/zip": {"schema": _PICTURE},
        "application/octet-stream": {"schema": _PICTURE},
    },
}
"""Body of ``POST /v1/labels``."""

FRAME: dict[str, Any] = {
    "required": True,
    "description": "The picture, or parts: the picture, its foreground mask, or both.",
    "content": {
        "image/*": {"schema": _PICTURE},
        "application/octet-stream": {"schema": _PICTURE},
        "multipart/form-data": {
            "schema": {
                "type": "object",
                "properties": {
                    "image": _PICTURE | {"description": "the picture"},
                    "mask": _PICTURE | {"description": "its foreground; no network looks then"},
                    "depth": _PICTURE
                    | {"description": "its depth map, as in an `instances` request"},
                },
                "additionalProperties": False,
            }
        },
    },
}
"""Body of ``POST /v1/tracks/{id}/frames``."""


_FLANGE = {
    "type": "array",
    "items": {"type": "array", "items": {"type": "number"}, "minItems": 6, "maxItems": 7},
    "description": "x, y, z, rotation of the flange, one a picture, in the recipe's unit and convention",
}

RUN: dict[str, Any] = {
    "required": False,
    "description": "The pictures alone: as parts in order, as one body, or by their ids.",
    "content": {
        "multipart/form-data": {
            "schema": {
                "type": "object",
                "properties": {
                    "image": {"type": "array", "items": _PICTURE, "description": "In order"},
                    "mask": {
                        "type": "array",
                        "maxItems": 1,
                        "items": _PICTURE,
                        "description": "Foreground",
                    },
                    "depth": {
                        "type": "array",
                        "maxItems": 1,
                        "items": _PICTURE,
                        "description": "Depth map or point cloud",
                    },
                    "flange": _FLANGE,
                },
                "additionalProperties": False,
            },
            "encoding": {"flange": {"contentType": "application/json"}},
        },
        "image/*": {"schema": _PICTURE},
        "application/octet-stream": {"schema": _PICTURE},
        "application/json": {"schema": {"$ref": f"{_SCHEMAS}RunInput"}, "example": {"images": []}},
    },
}
"""Body of ``POST /v1/recipes/{number}/run``."""

RECIPE_BODY: dict[str, Any] = {
    "required": True,
    "content": {
        "application/json": {"schema": {"$ref": f"{_SCHEMAS}RecipeBody"}, "example": RECIPE}
    },
}
"""Body of ``PUT /v1/recipes/{number}``."""

CALIBRATION: dict[str, Any] = {
    "required": True,
    "description": "The calibration, or a file of ROS, OpenCV or Kalibr with its intrinsics.",
    "content": {
        "application/json": {"schema": {"$ref": f"{_SCHEMAS}CameraBody"}, "example": CAMERA},
        "application/yaml": {"schema": {"type": "string"}},
    },
}
"""Body of ``PUT /v1/cameras/{name}``."""


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The ``responses`` of a route that may answer with these problems, or with those that any
    route may."""
    return {
        status: {"description": HTTPStatus(status).phrase, "content": _PROBLEM}
        for status in sorted({*statuses, 401, 403, 421, 422, 429, 500, 503})
    }


def describe(app: FastAPI) -> None:
    """Add the schemas of the requests to the document that FastAPI makes of ``app``."""
    of_routes = app.openapi

    def document() -> dict[str, Any]:
        made: dict[str, Any] = json.loads(
            json.dumps(of_routes()).replace(_generic_name(AnyJob), "Job")
        )
        requests = REQUEST.json_schema(ref_template=_SCHEMAS + "{model}")
        made["components"]["schemas"] |= requests.pop("$defs") | {"AnyRequest": requests}
        _as_3_1(made)
        for model in (RunInput, RecipeBody, CameraBody):
            schema = model.model_json_schema(ref_template=_SCHEMAS + "{model}")
            made["components"]["schemas"] |= schema.pop("$defs", {}) | {model.__name__: schema}
        return made

    app.openapi = document  # type: ignore[method-assign]


def _as_3_1(document: dict[str, Any]) -> None:
    """FastAPI describes an event stream by ``itemSchema``, which OpenAPI 3.2 has and 3.1 has
    not."""
    for methods in document["paths"].values():
        for operation in methods.values():
            for response in operation["responses"].values():
                for media in response.get("content", {}).values():
                    if media.pop("itemSchema", None) is not None:
                        media["schema"] = {
                            "type": "string",
                            "description": "Server-sent events, as they happen",
                        }


def _generic_name(model: type[BaseModel]) -> str:
    """What FastAPI calls a generic model: its parameters, spelled out."""
    return re.sub(r"[^\w.-]", "_", model.__name__, flags=re.ASCII)
