"""Corrections that come back: what changed in numbers, what is refused, and that nothing else is
lost."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import numpy as np
import pytest
from dlo_client.labelling import LabelledInstance, LabelStore, PictureLabel
from dlo_client.labelling import corrections as corrections_of
from dlo_client.labelling.corrections import compare, take_corrections
from dlo_client.labelling.formats import READERS, WRITERS, Imported
from dlo_client.labelling.store import Entry, corrected_file, read_label

from tests.clients.labelling import drawn


def bars(*rows: tuple[int, int]) -> PictureLabel:
    """10 × 10 pixels, an instance for each range of full rows."""
    items = []
    for k, (first, last) in enumerate(rows, start=1):
        mask = np.zeros((10, 10), bool)
        mask[first:last] = True
        items.append(LabelledInstance(id=k, mask_rle=drawn.rle(mask)))
    return PictureLabel(name="bars.png", width=10, height=10, instances=items)


@pytest.fixture
def store(tmp_path: Path):
    """Labels of three pictures, two of which share the last part of their name."""
    with LabelStore(tmp_path / "out", write=True) as opened:
        for name in (drawn.NAME, "left/a.png", "right/a.png"):
            opened.put(Entry(name, "done"), drawn.label(name))
        yield opened


def came_back(*labels: PictureLabel) -> Imported:
    return Imported(labels=[label.model_copy(update={"origin": "corrected"}) for label in labels])


def test_what_nobody_touched_is_no_change() -> None:
    change = compare(drawn.label(), drawn.label())
    assert change.untouched
    assert (change.iou, change.instance_iou, change.kept) == (1.0, 1.0, 3)


def test_a_change_is_measured() -> None:
    """By hand: the first bar is one row off (IoU 10 / 30: another DLO), the second one row thicker
    (20 / 30)."""
    change = compare(bars((0, 2), (5, 7)), bars((1, 3), (5, 8)))
    assert (change.kept, change.moved, change.added, change.removed) == (1, 1, 1, 1)
    assert change.iou == pytest.approx(30 / 60)
    assert change.instance_iou == pytest.approx(20 / 30 / 3)
    assert not change.untouched


@pytest.mark.parametrize(("before", "after"), [((), ()), (((0, 2),), ()), ((), ((0, 2),))])
def test_pictures_without_instances_can_be_compared(before, after) -> None:
    change = compare(bars(*before), bars(*after))
    assert change.untouched == (before == after)
    assert change.instance_iou == float(before == after)
    assert (change.removed, change.added) == (len(before), len(after))


def test_a_turned_crossing_counts_and_ids_need_not_be_kept() -> None:
    label = drawn.label()
    renumbered = [i.model_copy(update={"id": i.id + 10}) for i in label.instances]
    crossing = label.crossings[0]
    over, under = (
        p.model_copy(update={"instance": p.instance + 10}) for p in (crossing.over, crossing.under)
    )
    for upper, lower, turned in ((over, under, 0), (under, over, 1)):
        crossings = [crossing.model_copy(update={"over": upper, "under": lower})]
        after = label.model_copy(update={"instances": renumbered, "crossings": crossings})
        assert compare(label, after).reordered == turned


def test_a_correction_lies_beside_the_services_own(store: LabelStore) -> None:
    fewer = drawn.label().model_copy(update={"instances": drawn.label().instances[:2]})
    report = take_corrections(store, came_back(fewer))
    assert report.problems == {}
    assert [(c.name, c.removed, c.untouched) for c in report.changes] == [(drawn.NAME, 1, False)]
    filed = read_label(corrected_file(store.folder, drawn.NAME))
    assert (len(filed.instances), filed.origin) == (2, "corrected")
    assert len(store.label(drawn.NAME).instances) == 3
    assert any("1 removed" in line for line in report.lines())


def test_tools_that_forget_folders_are_understood_where_the_name_is_unique(
    store: LabelStore,
) -> None:
    report = take_corrections(
        store, came_back(drawn.label("upload/näh bild.png"), drawn.label("a.png"))
    )
    assert [c.name for c in report.changes] == [drawn.NAME]
    assert list(report.problems) == ["a.png"], "left/a.png or right/a.png?"
    assert report.problems["a.png"] == "ambiguous: left/a.png or right/a.png"


def test_missing_pictures_and_other_sizes_are_named_and_cost_no_other(store: LabelStore) -> None:
    wide = drawn.label("left/a.png").model_copy(update={"width": drawn.WIDTH + 1})
    report = take_corrections(
        store, came_back(drawn.label("gone.png"), wide, drawn.label("right/a.png"))
    )
    assert [c.name for c in report.changes] == ["right/a.png"]
    assert report.problems.keys() == {"gone.png", "left/a.png"}
    assert f"{drawn.WIDTH + 1}×{drawn.HEIGHT}" in report.problems["left/a.png"]
    assert not corrected_file(store.folder, "left/a.png").exists()


def test_annotations_of_pictures_that_the_file_does_not_list_are_named(
    store: LabelStore, tmp_path: Path
) -> None:
    file = WRITERS["coco"](
        lambda: [drawn.label("left/a.png"), drawn.label("right/a.png")], tmp_path
    )
    whole = json.loads(file.read_text())
    whole["images"] = [image for image in whole["images"] if image["file_name"] == "right/a.png"]
    file.write_text(json.dumps(whole))
    report = take_corrections(store, READERS["coco"](file))
    assert [c.name for c in report.changes] == ["right/a.png"]
    assert list(report.problems.values()) == [
        "annotations of a picture that the file does not list"
    ]


def test_a_full_folder_costs_only_what_did_not_fit(
    store: LabelStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = corrections_of.write_whole

    def full(file: Path, content: bytes) -> None:
        if "left" in file.parts:
            raise OSError(errno.ENOSPC, "No space left on device")
        whole(file, content)

    monkeypatch.setattr(corrections_of, "write_whole", full)
    report = take_corrections(
        store, came_back(drawn.label("left/a.png"), drawn.label("right/a.png"))
    )
    assert [c.name for c in report.changes] == ["right/a.png"]
    assert report.problems == {"left/a.png": "cannot be filed: No space left on device"}


def test_a_label_file_that_was_damaged_is_named(store: LabelStore) -> None:
    store.label_file("left/a.png").write_text("{")
    report = take_corrections(
        store, came_back(drawn.label("left/a.png"), drawn.label("right/a.png"))
    )
    assert [c.name for c in report.changes] == ["right/a.png"]
    assert "no label" in report.problems["left/a.png"]
