"""What other tools draw becomes instances, or is named: the same rules for every format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dlo_client.labelling.formats import FormatError, Imported, Wanted
from dlo_client.labelling.formats.gate import ABSENT, UNSAID

from tests.clients.labelling import drawn, foreign
from tests.clients.labelling.foreign import SQUARE, coco, cvat, flat, read, region, shape, task

LINE = [[5.5, 10.5], [40.5, 30.5], [80.5, 20.5]]


def percent(points: list[list[float]]) -> list[list[float]]:
    return [[100 * x / drawn.WIDTH, 100 * y / drawn.HEIGHT] for x, y in points]


def polygon_in(tool: str, folder: Path, points: list[list[Any]]) -> Imported:
    """A first picture with this polygon, a second one with a good one."""
    if tool == "coco":
        return read(tool, folder, coco([{"segmentation": [flat(points)]}], [{}]))
    if tool == "cvat":
        return read(tool, folder, cvat(shape("polygon", points), shape("polygon", SQUARE)))
    given = [
        region("polygonlabels", {"points": p, "closed": True}) for p in (points, percent(SQUARE))
    ]
    return read(tool, folder, [task("0.png", given[0]), task("1.png", given[1])])


def areas(imported: Imported, name: str) -> list[int]:
    (label,) = (label for label in imported.labels if label.name == name)
    return [int(drawn.mask(item).sum()) for item in label.instances]


@pytest.mark.parametrize("tool", ["coco", "cvat", "label-studio"])
@pytest.mark.parametrize(
    "wrong", [float("nan"), float("inf"), -float("inf"), 1e9, -1e9, 1e308, 10**400]
)
def test_a_coordinate_that_is_none_costs_that_picture_alone(
    tmp_path: Path, tool: str, wrong: float
) -> None:
    """NaN, infinity and 1e9 ended the process: out of memory, or a segmentation fault."""
    imported = polygon_in(tool, tmp_path, [[10, 10], [wrong, 10], [30, 20]])
    assert list(imported.problems) == ["0.png"]
    assert areas(imported, "1.png") == [200]


@pytest.mark.slow
@pytest.mark.parametrize("tool", ["coco", "cvat", "label-studio"])
def test_outlines_that_would_fill_the_memory_are_refused(tmp_path: Path, tool: str) -> None:
    """Every point is near the picture, but the way along them is endless, or there are too many."""
    zigzag = [[0, 0], [90, 60], [0, 60]] * 30_000
    assert "longer than" in polygon_in(tool, tmp_path, zigzag).problems["0.png"]
    assert "points" in polygon_in(tool, tmp_path, [[1, 1]] * 200_001).problems["0.png"]


@pytest.mark.parametrize("size", [0, -1, 1e9, 65_536, None, "wide", float("nan"), 10.5, True])
def test_a_picture_without_a_plausible_size_is_refused(tmp_path: Path, size: Any) -> None:
    content = coco([{}], [{}])
    content["images"][0]["width"] = size
    imported = read("coco", tmp_path, content)
    assert "width" in imported.problems["0.png"]
    assert areas(imported, "1.png") == [200]


def test_a_picture_of_too_many_pixels_is_refused_before_anything_is_filled(tmp_path: Path) -> None:
    content = coco([{}])
    content["images"][0] |= {"width": 60_000, "height": 60_000}
    assert "more than" in read("coco", tmp_path, content).problems["0.png"]


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        ([0, 10**12], "each is a whole number"),
        ([-5, 6305], "each is a whole number"),
        ([6300.5], "each is a whole number"),
        ([float("nan")], "each is a whole number"),
        (["a"], "no numbers"),
        ([1] * 20_000, "do not fill"),
        ([10], "do not fill"),
        ("~~~", "no run-length"),
        ("0" * 100_000, "do not fill"),
        (None, "neither a string"),
        (7, "neither a string"),
    ],
)
def test_run_lengths_that_do_not_fit_are_refused(tmp_path: Path, counts: Any, said: str) -> None:
    mask = {"size": [drawn.HEIGHT, drawn.WIDTH], "counts": counts}
    imported = read("coco", tmp_path, coco([{"segmentation": mask}], [{}]))
    assert said in imported.problems["0.png"]
    assert areas(imported, "1.png") == [200]


def test_our_own_labels_are_checked_when_they_come_back(tmp_path: Path) -> None:
    """The library read past the end of run lengths that do not fill the picture."""
    record = json.loads(drawn.label("a.png").model_dump_json())
    record["instances"][0]["mask_rle"]["counts"] = "0"
    text = json.dumps(record) + "\n" + drawn.label("b.png").model_dump_json() + "\n"
    imported = read("json", tmp_path, text)
    assert list(imported.problems) == ["a.png"]
    assert [label.name for label in imported.labels] == ["b.png"]


# Ids and crossings
# ---------------------------------------------------------------------------------------------------


def test_what_was_added_gets_an_id_of_its_own(tmp_path: Path) -> None:
    """After a deletion and an addition the ids were 2, 3, 3; through CVAT's groups two cables were
    then one."""
    content = coco([{"instance": 2}, {"instance": 3}, {}])
    assert [i.id for i in read("coco", tmp_path, content).labels[0].instances] == [2, 3, 4]


@pytest.mark.parametrize(
    ("given", "ids"),
    [
        ([3, 3, 3], [3, 4, 5]),
        ([None, 1, None], [2, 1, 3]),
        ([0, -4, "x"], [1, 2, 3]),
        (["2", 2.0, 1], [2, 3, 1]),
        ([2**31, 10**30, 1.5], [1, 2, 3]),
    ],
)
def test_ids_are_kept_once_and_told_apart(tmp_path: Path, given: list[Any], ids: list[int]) -> None:
    content = coco([{"instance": k} for k in given])
    assert [i.id for i in read("coco", tmp_path, content).labels[0].instances] == ids


def test_a_new_cable_does_not_take_over_the_crossing_of_a_deleted_one(tmp_path: Path) -> None:
    content = coco([{"instance": 1}, {}])
    content["images"][0]["crossings"] = [foreign.crossing(1, 2)]
    (label,) = read("coco", tmp_path, content).labels
    assert ([i.id for i in label.instances], label.crossings) == ([1, 3], [])


def with_crossing(tool: str, folder: Path, raw: dict[str, Any]) -> Imported:
    """Cable 1 alone, and a crossing."""
    if tool == "coco":
        content = coco([{"instance": 1}])
        content["images"][0]["crossings"] = [raw]
        return read(tool, folder, content)
    if tool == "cvat":
        facts = {}
        for key in ("over", "under"):
            facts |= {key: raw[key]["instance"], f"{key}_u": raw[key]["u"]} if raw.get(key) else {}
        point = shape("points", [[20, 15]], facts, label="crossing")
        return read(tool, folder, cvat(shape("polygon", SQUARE, group_id=1) + point))
    if tool == "json":
        label = drawn.label("0.png")
        given = json.loads(
            label.model_copy(update={"instances": label.instances[:1]}).model_dump_json()
        )
        return read(tool, folder, json.dumps(given | {"crossings": [raw]}))
    point = region("keypointlabels", {"x": 20, "y": 20}, "crossing", id="crossing-1")
    square = region("polygonlabels", {"points": percent(SQUARE)}, id="dlo-1-mask")
    meta = {"dlo_name": "0.png", "crossings": [raw] if raw else []}
    return read(tool, folder, [task("0.png", square, point, meta=meta)])


@pytest.mark.parametrize("tool", ["coco", "cvat", "label-studio", "json"])
def test_crossings_of_removed_cables_go_with_them(tmp_path: Path, tool: str) -> None:
    """A crossing that names nobody stayed in the label."""
    imported = with_crossing(tool, tmp_path, foreign.crossing(1, 2))
    assert imported.labels[0].crossings == []
    assert imported.notes == {ABSENT: {"0.png": 1}}
    kept = with_crossing(tool, tmp_path, foreign.crossing(1, 1))
    assert (len(kept.labels[0].crossings), kept.notes) == (1, {})


@pytest.mark.parametrize("tool", ["coco", "cvat", "label-studio"])
def test_a_crossing_that_says_nothing_costs_no_picture(tmp_path: Path, tool: str) -> None:
    imported = with_crossing(tool, tmp_path, {})
    assert (imported.problems, imported.notes) == ({}, {UNSAID: {"0.png": 1}})
    assert areas(imported, "0.png") == [200]


@pytest.mark.parametrize(
    "wrong", [7, "x", None, [], {"xy": [1, 2]}, {"xy": [1e99, 0]}, {"over": "1"}]
)
def test_crossings_of_any_form_cost_no_picture(tmp_path: Path, wrong: Any) -> None:
    content = coco([{"instance": 1}])
    content["images"][0]["crossings"] = [foreign.crossing(1, 1), wrong]
    imported = read("coco", tmp_path, content)
    assert len(imported.labels[0].crossings) == 1
    assert imported.notes == {UNSAID: {"0.png": 1}}


# Shapes
# --------------------------------------------------------------------------------------------------------------


def test_a_line_with_a_width_becomes_a_stroke(tmp_path: Path) -> None:
    line = [[5, 10], [85, 10]]
    given = {"segmentation": [], "centerline_xy": line, "width_px": 5}
    (item,) = read("coco", tmp_path, coco([given])).labels[0].instances
    rows = np.flatnonzero(drawn.mask(item)[:, 45])
    assert rows.tolist() == [8, 9, 10, 11, 12]
    assert (item.width_px, item.centerline_xy) == (5.0, [(5.0, 10.0), (85.0, 10.0)])


@pytest.mark.parametrize(
    "ring", [LINE[:2], [*LINE, LINE[1]], [*LINE, LINE[1], LINE[0]], [[5, 5], [50, 5], [20, 5]]]
)
def test_a_polygon_without_an_area_is_a_stroke_with_a_width_and_named_without(
    tmp_path: Path, ring: Any
) -> None:
    """It became an instance with an empty mask."""
    (item,) = (
        read("coco", tmp_path, coco([{"segmentation": [flat(ring)], "width_px": 6}]))
        .labels[0]
        .instances
    )
    assert drawn.mask(item).sum() > 100
    imported = read("coco", tmp_path, coco([{"segmentation": [flat(ring)]}], [{}]))
    assert list(imported.problems) == ["0.png"]
    assert areas(imported, "1.png") == [200]


@pytest.mark.parametrize(
    "wrong",
    [
        {"segmentation": [], "bbox": [3, 3, 20, 9]},
        {"segmentation": None},
        {"segmentation": "x"},
        {"segmentation": [[]]},
        {"segmentation": [[1, 2]]},
        {"segmentation": [[1, 2, 3]]},
        {"segmentation": [], "centerline_xy": [[4, 4]], "width_px": 5},
        {"segmentation": [], "centerline_xy": [[-80, -60], [-70, -60]], "width_px": 5},
        {"segmentation": [[-80, -60, -70, -60, -70, -50]]},
        {"segmentation": {"size": [70, 90], "counts": [6300]}},
        {"segmentation": {"size": [90, 70], "counts": [0, 6300]}},
        {"width_px": -2},
        {"width_px": 1e9},
        {"width_px": "wide"},
    ],
)
def test_what_is_no_cable_is_named(tmp_path: Path, wrong: dict[str, Any]) -> None:
    imported = read("coco", tmp_path, coco([wrong], [{}]))
    assert list(imported.problems) == ["0.png"]
    assert areas(imported, "1.png") == [200]


@pytest.mark.parametrize(
    "wrong",
    [
        '<box label="dlo" xtl="3" ytl="3" xbr="30" ybr="20"/>',
        '<ellipse label="dlo" cx="30" cy="20" rx="10" ry="5"/>',
        '<cuboid label="dlo" xtl1="3" ytl1="3"/>',
        '<tag label="dlo"/>',
        '<points label="dlo" points="1,1;2,2"/>',
        '<skeleton label="dlo"/>',
        shape("polyline", [[30.5, 20.5]]),
        shape("polyline", []),
        shape("polygon", SQUARE[:2]),
        '<polygon label="dlo" points="1,2;3"/>',
        '<polygon label="dlo"/>',
        '<mask label="dlo" rle="4" left="80" top="1" width="20" height="2"/>',
        '<mask label="dlo" rle="4, 2" left="1" top="1" width="2" height="3.5"/>',
        '<mask label="dlo" rle="" left="1" top="1" width="2" height="2"/>',
    ],
)
def test_shapes_of_cvat_that_are_no_cable_are_named(tmp_path: Path, wrong: str) -> None:
    """Box, ellipse and one-point line became instances with an empty mask."""
    imported = read("cvat", tmp_path, cvat(wrong, shape("polygon", SQUARE)))
    assert list(imported.problems) == ["0.png"]
    assert areas(imported, "1.png") == [200]


def test_pieces_of_a_group_are_one_cable(tmp_path: Path) -> None:
    """Of two lines in a group the first was lost. They are joined where they are nearest."""
    pieces = [
        shape("polyline", points, group_id=7)
        for points in (LINE[1::-1], [[60.5, 25.5], [80.5, 20.5]])
    ]
    imported = read("cvat", tmp_path, cvat("".join(pieces)))
    (item,) = imported.labels[0].instances
    mask = drawn.mask(item)
    assert item.centerline_xy == [(80, 20), (60, 25), (40, 30), (5, 10)]
    assert mask[10, 6]
    assert mask[20, 79]
    assert not mask[27, 50], "the cable is not seen between them"
    assert list(imported.notes.values()) == [{"0.png": 1}], "a width that was not named is said"


# Classes
# -------------------------------------------------------------------------------------------------------------


def of_two_classes(tool: str, folder: Path, wanted: Wanted | None = None) -> Imported:
    if tool == "coco":
        return read(tool, folder, coco([{}, {"category_id": 2}], [{}]), wanted)
    if tool == "cvat":
        both = shape("polygon", SQUARE) + shape("polygon", SQUARE, label="connector")
        return read(tool, folder, cvat(both, shape("polygon", SQUARE)), wanted)
    regions = [
        region("polygonlabels", {"points": percent(SQUARE)}, c, id=c) for c in ("dlo", "connector")
    ]
    return read(tool, folder, [task("0.png", *regions), task("1.png", regions[0])], wanted)


@pytest.mark.parametrize("tool", ["coco", "cvat", "label-studio"])
def test_other_classes_are_left_out_and_counted(tmp_path: Path, tool: str) -> None:
    """Connectors became cables."""
    imported = of_two_classes(tool, tmp_path)
    assert (areas(imported, "0.png"), areas(imported, "1.png")) == ([200], [200])
    assert imported.notes == {"class 'connector' left out": {"0.png": 1}}


@pytest.mark.parametrize("tool", ["coco", "cvat", "label-studio"])
def test_the_class_can_be_named(tmp_path: Path, tool: str) -> None:
    imported = of_two_classes(tool, tmp_path, Wanted(frozenset({"Connector "})))
    assert areas(imported, "0.png") == [200]
    assert areas(imported, "1.png") == []
    both = of_two_classes(tool, tmp_path, Wanted(frozenset({"dlo", "connector"})))
    assert areas(both, "0.png") == [200, 200]


@pytest.mark.parametrize("tool", ["coco", "cvat", "label-studio"])
def test_a_file_in_which_nothing_has_the_class_is_not_a_file_of_empty_pictures(
    tmp_path: Path, tool: str
) -> None:
    imported = of_two_classes(tool, tmp_path, Wanted(frozenset({"cable"})))
    assert imported.labels == []
    assert imported.problems.keys() == {"0.png", "1.png"}
    assert "'connector', 'dlo'" in imported.problems["0.png"]


@pytest.mark.parametrize("crowd", [1, "1", True, "true"])
def test_crowds_are_left_out_and_counted(tmp_path: Path, crowd: Any) -> None:
    whole = {"size": [drawn.HEIGHT, drawn.WIDTH], "counts": [0, drawn.HEIGHT * drawn.WIDTH]}
    imported = read("coco", tmp_path, coco([{}, {"iscrowd": crowd, "segmentation": whole}]))
    assert areas(imported, "0.png") == [200]
    assert imported.notes == {"iscrowd region left out": {"0.png": 1}}


# COCO's ids of pictures
# ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("write", [str, float, lambda k: f" {k} ", lambda k: f"0{k}"])
def test_ids_of_pictures_may_be_text(tmp_path: Path, write: Any) -> None:
    """As text they filed every picture as free of cables, over earlier corrections."""
    content = coco([{}], [{}, {}])
    for annotation in content["annotations"]:
        annotation["image_id"] = write(annotation["image_id"])
        annotation["category_id"] = write(annotation["category_id"])
    imported = read("coco", tmp_path, content)
    assert (areas(imported, "0.png"), areas(imported, "1.png")) == ([200], [200, 200])


def test_pictures_without_annotations_are_not_taken_where_annotations_are_lost(
    tmp_path: Path,
) -> None:
    content = coco([{}], [{}], [])
    content["annotations"][1]["image_id"] = "one"
    imported = read("coco", tmp_path, content)
    assert [label.name for label in imported.labels] == ["0.png"]
    assert imported.problems.keys() == {"image_id one", "1.png", "2.png"}


@pytest.mark.parametrize(
    "wrong",
    [
        [],
        7,
        {"images": []},
        {"images": {}, "annotations": []},
        {"images": [{"id": 1, "file_name": "a"}, {"id": "1", "file_name": "b"}], "annotations": []},
    ],
)
def test_what_is_no_coco_file_is_refused_whole(tmp_path: Path, wrong: Any) -> None:
    with pytest.raises(FormatError):
        read("coco", tmp_path, wrong)


@pytest.mark.parametrize("annotation", [7, None, [], {}, {"image_id": None}, {"image_id": {}}])
def test_an_annotation_of_no_picture_is_named(tmp_path: Path, annotation: Any) -> None:
    content = coco([{}])
    content["annotations"].append(annotation)
    imported = read("coco", tmp_path, content)
    assert areas(imported, "0.png") == [200]
    assert len(imported.problems) == 1


def test_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    for tool, content in (
        ("coco", json.dumps(coco([{}]))),
        ("json", drawn.label("0.png").model_dump_json()),
    ):
        assert len(read(tool, tmp_path, "\ufeff" + content).labels) == 1
