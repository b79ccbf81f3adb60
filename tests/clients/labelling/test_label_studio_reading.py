"""What Label Studio exports, by its documentation: who annotated what, on a picture turned how."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dlo_client.labelling.formats import Imported, Wanted

from tests.clients.labelling import drawn
from tests.clients.labelling.foreign import read, region, task

BOX = [[10, 20], [30, 20], [30, 40], [10, 40]]
"""Percent: 18 × 14 pixels from (9, 14) on."""


def polygon(points: list[list[float]] = BOX, **more: Any) -> dict[str, Any]:
    return region("polygonlabels", {"points": points}, **more)


def of(folder: Path, *tasks: Any) -> Imported:
    return read("label-studio", folder, list(tasks))


def mask(imported: Imported, k: int = 0) -> np.ndarray:
    return drawn.mask(imported.labels[0].instances[k])


@pytest.mark.parametrize(
    ("annotations", "why"),
    [
        ([{"was_cancelled": True, "result": []}], "skipped"),
        (
            [{"was_cancelled": True, "result": [polygon()]}, {"was_cancelled": True, "result": []}],
            "skipped",
        ),
        ([], "never annotated"),
        (None, "never annotated"),
    ],
)
def test_what_nobody_annotated_is_counted(tmp_path: Path, annotations: Any, why: str) -> None:
    """Skipped tasks, and those that nobody opened, became corrections and entered the training
    set."""
    open_task = task("0.png") | {
        "annotations": annotations,
        "predictions": [{"result": [polygon()]}],
    }
    imported = of(tmp_path, open_task, task("1.png", polygon()))
    assert imported.not_annotated == {"0.png": why}
    assert [label.name for label in imported.labels] == ["1.png"]


def test_an_empty_annotation_says_that_there_is_no_cable(tmp_path: Path) -> None:
    (label,) = of(tmp_path, task("0.png")).labels
    assert (label.instances, label.width) == ([], drawn.WIDTH)


def test_the_ground_truth_goes_before_the_latest(tmp_path: Path) -> None:
    first = {
        "result": [polygon(id="a"), polygon(id="b")],
        "updated_at": "2026-01-01",
        "ground_truth": True,
    }
    latest = {"result": [polygon()], "updated_at": "2026-01-02"}
    imported = of(tmp_path, task("0.png") | {"annotations": [first, latest]})
    assert len(imported.labels[0].instances) == 2
    assert imported.notes == {"several annotations, the latest taken": {"0.png": 1}}


@pytest.mark.parametrize(
    ("turned", "rows", "columns"),
    [
        (90, (49, 62), (18, 35)),
        (180, (42, 55), (63, 80)),
        (270, (7, 20), (54, 71)),
        (360, (14, 27), (9, 26)),
    ],
)
def test_a_region_on_a_turned_picture_is_turned_back(
    tmp_path: Path, turned: int, rows: Any, columns: Any
) -> None:
    """By hand: of 90 × 70 pixels shown turned to the right, the point (x, y) % is (y, 100 - x) %
    upright."""
    imported = of(tmp_path, task("0.png", polygon(image_rotation=turned)))
    seen = mask(imported)
    assert (np.flatnonzero(seen.any(1))[0], np.flatnonzero(seen.any(1))[-1]) == rows
    assert (np.flatnonzero(seen.any(0))[0], np.flatnonzero(seen.any(0))[-1]) == columns
    assert (imported.notes != {}) == (turned != 360)


@pytest.mark.parametrize("wrong", [45, "left", float("nan")])
def test_another_turn_is_named(tmp_path: Path, wrong: Any) -> None:
    imported = of(tmp_path, task("0.png", polygon(image_rotation=wrong)), task("1.png", polygon()))
    assert "image_rotation" in imported.problems["0.png"]
    assert [label.name for label in imported.labels] == ["1.png"]


def test_lines_on_a_turned_picture_are_turned_back_and_brushes_named(tmp_path: Path) -> None:
    vertices = [{"x": 0, "y": 50}, {"x": 100, "y": 50}]
    line = region("vectorlabels", {"vertices": vertices}, image_rotation=90)
    assert of(tmp_path, task("0.png", line)).labels[0].instances[0].centerline_xy == [
        (44.5, 69.5),
        (44.5, -0.5),
    ]
    brush = region("brushlabels", {"rle": [0, 0], "format": "rle"}, image_rotation=90)
    assert "brush on a turned picture" in of(tmp_path, task("0.png", brush)).problems["0.png"]


@pytest.mark.parametrize("kind", ["rectangle", "ellipse", "keypoint", "bitmask"])
def test_shapes_that_are_no_outline_are_named(tmp_path: Path, kind: str) -> None:
    """A rectangle was dropped: the picture lost a cable without a word."""
    value = {"x": 10, "y": 20, "width": 30, "height": 5, "rotation": 30, "radiusX": 3, "radiusY": 2}
    imported = of(tmp_path, task("0.png", polygon(), region(f"{kind}labels", value)))
    assert "no outline of a cable" in imported.problems["0.png"]


def test_generic_labels_are_labels(tmp_path: Path) -> None:
    """Both as one result, and as a shape and its label that share an id."""
    whole = region("labels", {"points": BOX}, id="a")
    shape = {**region("polygon", {"points": BOX}, id="b"), "value": {"points": BOX}}
    its_label = {**region("labels", {"points": BOX}, id="b")}
    (label,) = of(tmp_path, task("0.png", whole, shape, its_label)).labels
    assert [int(drawn.mask(i).sum()) for i in label.instances] == [18 * 14, 18 * 14]


def test_shapes_without_a_label_and_answers_are_counted(tmp_path: Path) -> None:
    bare = {**polygon(id="a"), "value": {"points": BOX}}
    choice = {"id": "c", "type": "choices", "value": {"choices": ["blurred"]}}
    relation = {"type": "relation", "from_id": "a", "to_id": "b"}
    imported = of(tmp_path, task("0.png", polygon(), bare, choice, relation))
    assert len(imported.labels[0].instances) == 1
    assert imported.notes.keys() == {
        "polygon without a label left out",
        "result of type 'choices' left out",
        "result of type 'relation' left out",
    }


def test_a_line_is_closed_where_the_tool_closed_it(tmp_path: Path) -> None:
    vertices = [{"x": x, "y": y} for x, y in BOX]
    (closed,) = of(
        tmp_path, task("0.png", region("vectorlabels", {"vertices": vertices, "closed": True}))
    ).labels
    (item,) = closed.instances
    assert item.closed
    assert drawn.mask(item)[21, 9], "the way back to the first point is drawn"
    (label,) = of(tmp_path, task("0.png", region("vectorlabels", {"vertices": vertices}))).labels
    assert not label.instances[0].closed
    assert not drawn.mask(label.instances[0])[21, 9]


def test_an_open_polygon_is_a_line(tmp_path: Path) -> None:
    (label,) = of(
        tmp_path, task("0.png", region("polygonlabels", {"points": BOX, "closed": False}))
    ).labels
    assert not drawn.mask(label.instances[0])[21, 18], "not filled"
    assert len(label.instances[0].centerline_xy) == 4


def test_a_line_that_branches_is_named_and_a_bent_one_is_said(tmp_path: Path) -> None:
    vertices: list[dict[str, Any]] = [
        {"id": str(k), "x": x, "y": y} for k, (x, y) in enumerate(BOX)
    ]
    vertices[2]["prevPointId"] = "0"
    assert (
        "branches"
        in of(tmp_path, task("0.png", region("vectorlabels", {"vertices": vertices}))).problems[
            "0.png"
        ]
    )
    vertices[2] |= {"prevPointId": "1", "isBezier": True}
    assert (
        len(of(tmp_path, task("0.png", region("vectorlabels", {"vertices": vertices}))).notes) == 2
    )


@pytest.mark.parametrize(
    "wrong", [7, None, {}, {"data": 3}, {"data": {}}, {"image": "a.png", "label": []}]
)
def test_what_is_no_task_is_named(tmp_path: Path, wrong: Any) -> None:
    imported = of(tmp_path, wrong, task("1.png", polygon()))
    assert list(imported.problems) == ["task 1"]
    assert [label.name for label in imported.labels] == ["1.png"]


@pytest.mark.parametrize(
    ("address", "name"),
    [
        ("/data/local-files/?d=a/b%20c.png", "a/b c.png"),
        ("/data/upload/3/0a1b2c3d-cam.jpg", "data/upload/3/cam.jpg"),
        ("http://host/pictures/cam.jpg?x=1", "pictures/cam.jpg"),
        ("s3://bucket/a/cam.jpg", "a/cam.jpg"),
    ],
)
def test_the_picture_is_named_by_its_address(tmp_path: Path, address: str, name: str) -> None:
    given = task("x", polygon()) | {"data": {"img": address}}
    assert [label.name for label in of(tmp_path, given).labels] == [name]


def test_the_size_of_an_empty_annotation_is_the_known_one(tmp_path: Path) -> None:
    bare = task("0.png") | {"data": {"image": "0.png"}}
    assert "width" in of(tmp_path, bare).problems["0.png"]
    (label,) = read("label-studio", tmp_path, [bare], Wanted(sizes={"0.png": (8, 6)})).labels
    assert (label.width, label.height) == (8, 6)
