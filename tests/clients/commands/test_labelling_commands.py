"""``dlo label-export``, ``-import``, ``-dataset`` and ``-tracked``: what they print, file and
refuse."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from dlo_client.commands import labelling_commands
from dlo_client.contracts import Job, LabelTrackedResult
from dlo_client.contracts.labelling import TrackedInstance, TrackedLabels
from dlo_client.labelling import LabelStore
from dlo_client.labelling.formats import WRITERS
from dlo_client.labelling.store import Entry, corrected_file, write_whole
from PIL import Image
from typer.testing import CliRunner, Result

from tests.clients import samples
from tests.clients.labelling import drawn

Dlo = Callable[..., Result]
POSE = np.eye(4).tolist()
INTRINSICS = {
    "width": drawn.WIDTH,
    "height": drawn.HEIGHT,
    "fx": 80.0,
    "fy": 80.0,
    "cx": 45.0,
    "cy": 35.0,
}
STROKES = [
    {"points_m": [[0, 0, 1], [0.1, 0, 1]], "thickness_m": 0.006, "name": name}
    for name in ("red", "blue", "w")
]


class Service:
    """Finds the drawn cables in every view, or refuses."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []
        self.refusal: int | None = None

    def __call__(self, request: httpx.Request) -> httpx.Response:
        self.asked.append(json.loads(request.content.split(b"\r\n\r\n")[1].split(b"\r\n--")[0]))
        if self.refusal:
            return httpx.Response(
                self.refusal, text=samples.refused(self.refusal, "invalid").model_dump_json()
            )
        views = [tracked_view(f"views.{k}") for k in range(len(self.asked[-1]["views"]))]
        result = LabelTrackedResult(
            views=views, warnings=["red: its corrections are doubtful"], models=[]
        )
        job = samples.job(kind="label_tracked", result=result)
        return httpx.Response(
            200, text=Job[LabelTrackedResult].model_validate(job.model_dump()).model_dump_json()
        )


def tracked_view(name: str) -> TrackedLabels:
    items = [
        TrackedInstance(
            id=i.id,
            name=STROKES[i.id - 1]["name"],
            score=0.9,
            centerline_xy=i.centerline_xy,
            width_px=i.width_px,
            endpoints=[],
            mask_rle=i.mask_rle,
            offset_px=[2.5] * len(i.centerline_xy),
            trust=[0.9] * len(i.centerline_xy),
        )
        for i in drawn.label().instances
    ]
    return TrackedLabels(
        name=name,
        width=drawn.WIDTH,
        height=drawn.HEIGHT,
        instances=items,
        crossings=drawn.label().crossings,
        moved_px=2.5,
        intrinsics=INTRINSICS,
        T_world_camera=POSE,
    )


@pytest.fixture
def service() -> Service:
    return Service()


@pytest.fixture
def dlo(service: Service) -> Dlo:
    def run(*arguments: object) -> Result:
        return CliRunner().invoke(
            labelling_commands.app, [str(a) for a in arguments], obj=httpx.MockTransport(service)
        )

    return run


@pytest.fixture
def labels(tmp_path: Path) -> Path:
    """A folder as `dlo label` leaves it, with two labels."""
    with LabelStore(tmp_path / "out", write=True) as store:
        for name in (drawn.NAME, "b.png"):
            store.put(Entry(name, "done"), drawn.label(name))
    return tmp_path / "out"


def one_line(done: Result) -> str:
    """A refusal is one line for a person, not a trace."""
    assert done.exit_code == 1
    assert isinstance(done.exception, SystemExit)
    (line,) = (line for line in done.output.splitlines() if line.strip())
    return line


def correction(folder: Path, *names: str) -> Path:
    """What a tool exports after somebody deleted the ring."""
    fewer = [
        drawn.label(n).model_copy(update={"instances": drawn.label().instances[:2]}) for n in names
    ]
    folder.mkdir(exist_ok=True)
    return WRITERS["coco"](lambda: fewer, folder)


def test_corrections_are_taken_and_what_they_changed_is_said(
    dlo: Dlo, labels: Path, tmp_path: Path
) -> None:
    done = dlo("label-import", labels, correction(tmp_path / "tool", drawn.NAME), "--tool", "coco")
    assert done.exit_code == 0, done.output
    assert "1 pictures came back, 1 of them changed, 0 refused" in done.stdout
    assert f"{drawn.NAME}: IoU 66.7 %, 0 moved, 0 added, 1 removed" in done.stdout
    dlo("label-export", labels, "--format", "coco")
    written = json.loads((labels / "coco.json").read_text())
    assert len(written["annotations"]) == 2 + 3, "the correction goes before the service's own"


def test_an_import_that_refers_to_missing_pictures_takes_the_rest(
    dlo: Dlo, labels: Path, tmp_path: Path
) -> None:
    done = dlo(
        "label-import", labels, correction(tmp_path / "tool", "gone.png", "b.png"), "--tool", "coco"
    )
    assert done.exit_code == 1, "a script must notice"
    assert "gone.png: no picture of this name was labelled here" in done.stdout
    assert corrected_file(labels, "b.png").exists()


@pytest.mark.parametrize("tool", ["coco", "cvat", "label-studio", "json"])
def test_an_import_of_what_is_no_export_is_refused(
    dlo: Dlo, labels: Path, tmp_path: Path, tool: str
) -> None:
    assert "nowhere" in one_line(dlo("label-import", labels, tmp_path / "nowhere", "--tool", tool))


def test_an_import_into_a_folder_without_labels_is_refused(dlo: Dlo, tmp_path: Path) -> None:
    file = correction(tmp_path / "tool", "b.png")
    assert "no labels there" in one_line(dlo("label-import", tmp_path, file, "--tool", "coco"))


def test_an_export_that_does_not_fit_says_so(dlo: Dlo, labels: Path) -> None:
    """A folder stands where the file should be: as with a full one, the system refuses to write."""
    (labels / "coco.json").mkdir()
    assert "coco.json" in one_line(dlo("label-export", labels, "--format", "coco"))


def test_corrected_pictures_become_a_training_set(dlo: Dlo, labels: Path, tmp_path: Path) -> None:
    buffer = io.BytesIO()
    Image.new("RGB", (drawn.WIDTH, drawn.HEIGHT)).save(buffer, "PNG")
    for name in (drawn.NAME, "b.png"):
        write_whole(tmp_path / "in" / name, buffer.getvalue())
    dlo("label-import", labels, correction(tmp_path / "tool", "b.png"), "--tool", "coco")
    done = dlo("label-dataset", labels, tmp_path / "in", tmp_path / "set")
    assert (done.exit_code, done.stdout) == (0, "")
    assert sorted(f.name for f in (tmp_path / "set").iterdir()) == [
        "b_png.png",
        "b_png_ids.png",
        "index.jsonl",
    ]
    assert dlo("label-dataset", labels, tmp_path / "in", tmp_path / "set", "--all").exit_code == 0
    assert len((tmp_path / "set" / "index.jsonl").read_text().splitlines()) == 2
    (tmp_path / "in" / drawn.NAME).unlink()
    done = dlo("label-dataset", labels, tmp_path / "in", tmp_path / "other", "--all")
    assert done.exit_code == 1
    assert done.stdout == f"{drawn.NAME}: the picture is no longer in the source\n"


def test_a_training_set_needs_pictures(dlo: Dlo, labels: Path, tmp_path: Path) -> None:
    assert "no such folder" in one_line(
        dlo("label-dataset", labels, tmp_path / "nowhere", tmp_path / "set")
    )


@pytest.fixture
def session(tmp_path: Path) -> list[Path]:
    """What `label-tracked` takes: cameras, strokes, and two pictures of the same name from two
    folders."""
    cameras = [{"intrinsics": INTRINSICS, "T_world_camera": POSE}] * 2
    (tmp_path / "cameras.json").write_text(json.dumps(cameras))
    (tmp_path / "strokes.json").write_text(json.dumps(STROKES))
    pictures = [tmp_path / side / "näh 1.png" for side in ("left", "right")]
    for picture in pictures:
        write_whole(picture, b"picture")
    return [tmp_path / "cameras.json", tmp_path / "strokes.json", *pictures]


def test_tracked_strokes_become_labels_like_those_of_a_batch(
    dlo: Dlo, service: Service, session: list[Path], tmp_path: Path
) -> None:
    done = dlo("label-tracked", *session, "--out", tmp_path / "out", "--format", "coco")
    assert done.exit_code == 0, done.output
    assert "näh 1.png: 3 cables, moved by 2.5 px" in done.stdout
    assert "warning: red: its corrections are doubtful" in done.stdout
    (asked,) = service.asked
    assert (asked["kind"], asked["priority"]) == ("label_tracked", "batch")
    assert [s["name"] for s in asked["strokes"]] == ["red", "blue", "w"]
    with LabelStore(tmp_path / "out") as store:
        filed = list(store.labels())
    assert [label.name for label in filed] == ["näh 1-2.png", "näh 1.png"], (
        "no picture writes over the other"
    )
    assert {label.origin for label in filed} == {"tracked"}
    assert [i.mask_rle for i in filed[0].instances] == [i.mask_rle for i in drawn.label().instances]
    assert len(json.loads((tmp_path / "out" / "coco.json").read_text())["annotations"]) == 6


def test_the_trackers_frame_goes_along(
    dlo: Dlo, service: Service, session: list[Path], tmp_path: Path
) -> None:
    frame = [[0, -1, 0, 0.3], [1, 0, 0, -0.2], [0, 0, 1, 0.1], [0, 0, 0, 1]]
    (tmp_path / "frame.json").write_text(json.dumps(frame))
    dlo("label-tracked", *session, "--out", tmp_path / "out", "--tracker", tmp_path / "frame.json")
    assert service.asked[0]["T_world_tracker"] == frame


@pytest.mark.parametrize(
    ("part", "content", "named"),
    [
        (0, None, "cameras.json"),
        (0, "[", "JSON"),
        (0, "[]", "0 cameras for 2 pictures"),
        (1, json.dumps([{"points_m": [[0, 0, 1]], "thickness_m": 0.006}]), "points_m"),
        (1, json.dumps([{"points_m": [[0, 0, 1], [1, 0, 1]], "thickness_m": -1}]), "thickness_m"),
        (3, None, "näh 1.png"),
    ],
)
def test_what_cannot_be_asked_is_refused_before_it_is(
    dlo: Dlo,
    service: Service,
    session: list[Path],
    tmp_path: Path,
    part: int,
    content: str | None,
    named: str,
) -> None:
    session[part].unlink()
    if content is not None:
        session[part].write_text(content)
    done = dlo("label-tracked", *session, "--out", tmp_path / "out")
    assert done.exit_code == 1
    assert isinstance(done.exception, SystemExit), done.exception
    assert named in done.output
    assert service.asked == []


def test_a_folder_that_takes_no_labels_is_refused_before_anything_is_asked(
    dlo: Dlo, service: Service, session: list[Path], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    assert "cannot be written" in one_line(
        dlo("label-tracked", *session, "--out", tmp_path / "file" / "out")
    )
    assert service.asked == []


def test_labels_of_a_batch_and_of_strokes_are_not_mixed(
    dlo: Dlo, service: Service, session: list[Path], tmp_path: Path
) -> None:
    with LabelStore(tmp_path / "out", write=True) as store:
        store.remember({"method": "rt_dlo"})
    assert "take another folder" in one_line(
        dlo("label-tracked", *session, "--out", tmp_path / "out")
    )
    assert service.asked == []


def test_a_refusal_of_the_service_is_said_and_files_nothing(
    dlo: Dlo, service: Service, session: list[Path], tmp_path: Path
) -> None:
    service.refusal = 422
    assert dlo("label-tracked", *session, "--out", tmp_path / "out").exit_code == 1
    with LabelStore(tmp_path / "out") as store:
        assert list(store.labels()) == []
