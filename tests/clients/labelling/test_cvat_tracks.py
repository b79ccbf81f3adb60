"""CVAT's video XML, frame by frame. It gave no picture at all, and exit code 0."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dlo_client.labelling.formats import FormatError, Imported, Wanted

from tests.clients.labelling import drawn
from tests.clients.labelling.foreign import SQUARE, read, shape

META = (
    "<meta><task><size>{length}</size>"
    "<original_size><width>90</width><height>70</height></original_size></task></meta>"
)
LINE = [[10.5, 10.5], [50.5, 10.5]]


def at(frame: int, tag: str = "polyline", points: list[list[float]] = LINE, **more: object) -> str:
    return shape(
        tag, points, {"width_px": 5}, frame=frame, label="", **{"outside": 0, "keyframe": 1} | more
    )


def track(*shapes: str, label: str = "dlo", number: int = 0) -> str:
    return f'<track id="{number}" label="{label}">{"".join(shapes)}</track>'


def of(
    folder: Path, *tracks: str, length: int = 10, names: tuple[str, ...] = (), **more: bool
) -> Imported:
    xml = f"<annotations>{META.format(length=length)}{''.join(tracks)}</annotations>"
    return read("cvat", folder, xml, Wanted(sizes=dict.fromkeys(names, (90, 70)), **more))


def starts(imported: Imported) -> dict[str, float]:
    """Frame → height of the first point of its only cable."""
    return {label.name: label.instances[0].centerline_xy[0][1] for label in imported.labels}


def test_a_shape_moves_between_keyframes_and_stays_after_the_last(tmp_path: Path) -> None:
    lower = [[x, y + 20] for x, y in LINE]
    imported = of(tmp_path, track(at(2), at(6, points=lower)), length=9)
    assert starts(imported) == {
        "frame_000002": 10,
        "frame_000003": 15,
        "frame_000004": 20,
        "frame_000005": 25,
        "frame_000006": 30,
        "frame_000007": 30,
        "frame_000008": 30,
    }
    assert imported.not_annotated.keys() == {"frame_000000", "frame_000001"}


def test_frames_that_are_written_out_are_taken_as_they_are(tmp_path: Path) -> None:
    odd = [[x, y + 3] for x, y in LINE]
    imported = of(tmp_path, track(at(0), at(1, points=odd, keyframe=0), at(2)), length=3)
    assert list(starts(imported).values()) == [10, 13, 10]


def test_outside_ends_a_shape_until_it_comes_back(tmp_path: Path) -> None:
    imported = of(tmp_path, track(at(0), at(2, outside=1), at(5)), length=7)
    assert list(starts(imported)) == [f"frame_00000{k}" for k in (0, 1, 5, 6)]
    assert starts(imported)["frame_000001"] == 10, "it does not move towards where it is not seen"


def test_several_tracks_are_several_cables_and_other_classes_counted(tmp_path: Path) -> None:
    square = track(at(1, "polygon", SQUARE), number=1)
    imported = of(
        tmp_path, track(at(0)), square, track(at(0), label="connector", number=2), length=2
    )
    assert [len(label.instances) for label in imported.labels] == [1, 2]
    assert imported.notes == {"class 'connector' left out": {"frame_000000": 1, "frame_000001": 1}}


@pytest.mark.parametrize("tag", ["polyline", "polygon"])
def test_shapes_of_other_numbers_of_points_move_by_their_length(tmp_path: Path, tag: str) -> None:
    box = [[10, 10], [30, 10], [30, 20], [10, 20]]
    finer = [[10, 20], [20, 20], [30, 20], [30, 30], [10, 30]]
    imported = of(tmp_path, track(at(0, tag, box), at(2, tag, finer)), length=3)
    middle = drawn.mask(imported.labels[1].instances[0])
    rows = np.flatnonzero(middle.any(1))
    assert (rows[0], rows[-1]) == ((15, 24) if tag == "polygon" else (13, 27))


def test_a_mask_stays_as_it_was(tmp_path: Path) -> None:
    mask = '<mask frame="{}" outside="0" keyframe="1" rle="0, 4" left="{}" top="1" width="2" height="2"/>'
    imported = of(tmp_path, track(mask.format(0, 5), mask.format(2, 50)), length=3)
    lefts = [
        int(np.flatnonzero(drawn.mask(label.instances[0]).any(0))[0]) for label in imported.labels
    ]
    assert lefts == [5, 5, 50]


def test_frames_find_their_pictures_by_name(tmp_path: Path) -> None:
    names = ("a/frame_000000.png", "a/frame_000003.jpg", "other.png")
    imported = of(tmp_path, track(at(0), at(4)), names=names)
    assert [label.name for label in imported.labels] == list(names[:2])
    assert imported.problems.keys() == {"1 frames (frame_000004)"}


def test_frames_are_taken_in_order_when_asked_or_as_many(tmp_path: Path) -> None:
    names = ("a.png", "b.png", "c.png")
    assert len(of(tmp_path, track(at(0)), length=3, names=names).labels) == 3
    assert [
        label.name
        for label in of(tmp_path, track(at(0)), length=1, names=names, in_order=True).labels
    ] == ["a.png"]
    unclear = of(tmp_path, track(at(0)), length=2, names=names)
    assert unclear.labels == []
    assert "in-order" in next(iter(unclear.problems.values()))


@pytest.mark.parametrize(
    "wrong",
    [
        at(-1),
        at(10**9),
        at(0, points=[[float("nan"), 1], [2, 2]]),
        at(0, points=[[1e9, 1], [2, 2]]),
        at(0, "box"),
        at(0, points=[]),
        '<polyline frame="x" points="1,2;3,4"/>',
    ],
)
def test_a_track_that_cannot_be_read_is_named(tmp_path: Path, wrong: str) -> None:
    imported = of(tmp_path, track(wrong), length=1)
    assert imported.labels == []
    assert len(imported.problems) == 1


def test_a_frame_of_another_size_than_its_picture_is_not_squeezed_in(tmp_path: Path) -> None:
    xml = f"<annotations>{META.format(length=1)}{track(at(0))}</annotations>"
    (label,) = read("cvat", tmp_path, xml, Wanted(sizes={"frame_000000.png": (50, 40)})).labels
    assert (label.width, label.height) == (90, 70), "refused when it is compared with the picture"


@pytest.mark.parametrize("empty", ["", "<meta/>", '<track id="0" label="dlo"/>'])
def test_a_file_that_holds_nothing_is_refused(tmp_path: Path, empty: str) -> None:
    with pytest.raises(FormatError, match="neither images nor tracks"):
        read("cvat", tmp_path, f"<annotations>{empty}</annotations>")


@pytest.mark.parametrize(
    "bomb",
    [
        '<!DOCTYPE a [<!ENTITY b "c">]><annotations/>',
        '<!DOCTYPE annotations SYSTEM "file:///etc/passwd"><annotations/>',
        '<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x "y"><!ENTITY z "&x;&x;">]><annotations>&z;</annotations>',
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_entities_are_refused_in_any_encoding(tmp_path: Path, bomb: str, encoding: str) -> None:
    """Only the bytes of UTF-8 were looked at: in UTF-16 they were expanded."""
    from dlo_client.labelling.formats import cvat

    file = tmp_path / "bomb.xml"
    file.write_bytes(bomb.encode(encoding))
    with pytest.raises(FormatError, match="document type"):
        cvat.read(file)
