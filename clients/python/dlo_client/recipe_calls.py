"""The calls of recipes and cameras as data, as in :mod:`dlo_client.calls`."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote
from uuid import uuid4

from dlo_client.calls import Call, JobOrId, job_path, reader, wait_params
from dlo_client.contracts import AnyJob
from dlo_client.contracts.recipes import CameraBody, Recipe, RecipeBody, StoredCamera
from dlo_client.errors import InvalidArgument
from dlo_client.pictures import Picture, Pictures, part_of, parts_of

_JSON = {"Content-Type": "application/json"}
_YAML = {"Content-Type": "application/yaml"}


def store(number: int, recipe: RecipeBody) -> Call[Recipe]:
    body = {"content": recipe.model_dump_json(exclude_none=True).encode()}
    return Call("PUT", _path(number), reader(Recipe), headers=_JSON, body=body)


def every() -> Call[list[Recipe]]:
    return Call("GET", "/v1/recipes", reader(list[Recipe]))


def run(
    number: int,
    images: Pictures | None = None,
    mask: Picture | None = None,
    flange: Sequence[Sequence[float]] = (),
    version: int | None = None,
    wait: float = 0.0,
    depth: Picture | None = None,
) -> Call[AnyJob]:
    """A run of a recipe; ``flange``: x, y, z, rotation of each picture."""
    parts = [("image", part) for part in parts_of(images, "images")]
    if mask is not None:
        parts.append(("mask", part_of(mask, "mask")))
    if depth is not None:
        parts.append(("depth", part_of(depth, "depth")))
    files = [(field, (name, data, "application/octet-stream")) for field, (name, data) in parts]
    poses = [[float(number) for number in pose] for pose in flange]
    if poses:
        files.append(("flange", ("flange", json.dumps(poses).encode(), "application/json")))
    body: Mapping[str, Any] = {"files": files} if files else {"json": {}}
    params: dict[str, Any] = {**wait_params(wait), **({"version": version} if version else {})}
    headers = {"Idempotency-Key": uuid4().hex}
    path = f"{_path(number)}/run"
    return Call(
        "POST", path, reader(AnyJob), params=params, headers=headers, body=body, held_s=wait
    )


def dry_run(number: int) -> Call[list[AnyJob]]:
    return Call("POST", f"{_path(number)}/dry-run", reader(list[AnyJob]))


def of_job(job: JobOrId) -> Call[RecipeBody]:
    return Call("GET", f"{job_path(job)}/recipe", reader(RecipeBody))


def store_camera(name: str, camera: CameraBody | Picture) -> Call[StoredCamera]:
    path = f"/v1/cameras/{quote(name, safe='')}"
    if isinstance(camera, CameraBody):
        data, headers = camera.model_dump_json(exclude_none=True).encode(), _JSON
    else:
        data, headers = part_of(camera, "camera").data, _YAML
    return Call("PUT", path, reader(StoredCamera), headers=headers, body={"content": data})


def cameras() -> Call[list[StoredCamera]]:
    return Call("GET", "/v1/cameras", reader(list[StoredCamera]))


def _path(number: int) -> str:
    if not isinstance(number, int) or number < 0:
        raise InvalidArgument("number", f"{number!r} is no number of a recipe")
    return f"/v1/recipes/{number}"
