"""CVAT's serverless function as nuclio calls it."""

from __future__ import annotations

import base64
import importlib.util
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from dlo_client.errors import ConnectionFailed

from tests.clients import samples

FOLDER = Path(__file__).parents[2] / "clients" / "cvat"


@pytest.fixture
def function():
    spec = importlib.util.spec_from_file_location("cvat_main", FOLDER / "main.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def context(run):
    """nuclio's: ``user_data`` and ``Response``."""
    client = SimpleNamespace(run=run)
    return SimpleNamespace(
        user_data=SimpleNamespace(client=client),
        Response=lambda **fields: SimpleNamespace(**fields),
    )


def event(**body) -> SimpleNamespace:
    return SimpleNamespace(body=body)


PICTURE = base64.b64encode(b"picture").decode()


def test_masks_and_centerlines_in_cvat_s_form(function):
    given = []
    reply = function.handler(
        context(lambda _, image: given.append(image) or samples.two_cables()), event(image=PICTURE)
    )
    assert given == [b"picture"]
    shapes = json.loads(reply.body)
    assert reply.status_code == 200
    masks = [shape for shape in shapes if shape["type"] == "mask"]
    for shape, instance in zip(masks, samples.two_cables().instances, strict=True):
        *inside, left, top, right, bottom = shape["mask"]
        back = np.zeros((samples.HEIGHT, samples.WIDTH), bool)
        box = np.array(inside, bool).reshape(bottom - top + 1, right - left + 1)
        back[top : bottom + 1, left : right + 1] = box
        assert (back == instance.mask_rle.array()).all()
    lines = [shape for shape in shapes if shape["type"] == "polyline"]
    x, y = samples.two_cables().instances[0].centerline_xy[0]
    assert lines[0]["points"][:2] == [x + 0.5, y + 0.5], "CVAT counts from a pixel's corner"


def test_a_threshold_leaves_out(function):
    reply = function.handler(
        context(lambda *_: samples.two_cables()), event(image=PICTURE, threshold=1.0)
    )
    assert json.loads(reply.body) == []


def test_errors_are_statuses(function):
    def away(*_):
        raise ConnectionFailed("away")

    assert function.handler(context(away), event(image=PICTURE)).status_code == 502
    assert function.handler(context(away), event(other=1)).status_code == 400


def test_the_description_names_the_shapes_that_are_made(function):
    described = yaml.safe_load((FOLDER / "function.yaml").read_text())
    listed = json.loads(described["metadata"]["annotations"]["spec"])
    made = {
        (shape["label"], shape["type"])
        for shape in function.shapes_of(samples.two_cables().instances[0])
    }
    assert {(one["name"], one["type"]) for one in listed} == made
    assert described["spec"]["handler"] == "main:handler"
