"""A scan along a cable: where it moves, what it asks, when it ends; and the commands around it."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path

import httpx
import numpy as np
import pytest
from dlo_client import AsyncClient, InvalidArgument
from dlo_client.commands import reconstruction_commands
from dlo_client.commands.app import app
from dlo_client.contracts import (
    MergeCurvesRequest,
    MergeCurvesResult,
    NextViewRequest,
    NextViewResult,
    ReconstructRequest,
)
from dlo_client.demo.scan_picture import svg
from dlo_client.errors import JobFailed
from dlo_client.scan import Scan, ScanOptions, reversed_curve
from typer.testing import CliRunner

from tests.clients import curve_samples, samples
from tests.clients.curve_samples import pose, straight

CABLE = (-0.4, 0.4)
REACH_M = 0.1


class Table:
    """A service over a straight cable along y: a picture shows what lies within 10 cm of its
    camera."""

    def __init__(self) -> None:
        self.requests: list = []
        self.lost_beyond: float | None = None

    def run(self, request, image=None):
        self.requests.append(request)
        match request:
            case ReconstructRequest():
                assert len(image) == len(request.views)
                result = self._seen(request)
            case NextViewRequest():
                y = request.curve.points_m[-1][1] if request.advance else 0.0
                result = NextViewResult(next_view=curve_samples.next_view(y))
            case MergeCurvesRequest():
                ys = [p[1] for curve in request.curves for p in curve.points_m]
                result = MergeCurvesResult(
                    curve=straight(min(ys), max(ys)), disagreement_m=0.0, outliers=0
                )
        return result

    def _seen(self, request: ReconstructRequest):
        y = request.views[0].T_world_camera[1][3]
        if self.lost_beyond is not None and abs(y) > self.lost_beyond:
            raise JobFailed(
                samples.failed(samples.refused(422)), samples.refused(422, "invalid_views")
            )
        low, high = max(y - REACH_M, CABLE[0]), min(y + REACH_M, CABLE[1])
        curve = straight(low, high)
        if (
            request.previous is not None
            and request.previous.points_m[-1][1] < request.previous.points_m[0][1]
        ):
            curve = reversed_curve(curve)
        ends = tuple(
            "free" if abs(point[1]) == CABLE[1] else "border"
            for point in (curve.points_m[0], curve.points_m[-1])
        )
        return curve_samples.result(curve, ends=ends)


class Arm:
    """Stops a little beside where it was sent, and knows it."""

    intrinsics = curve_samples.INTRINSICS.model_dump()

    def __init__(self) -> None:
        self._pose = pose(0.0)
        self.visited: list[float] = []

    def pose(self):
        return self._pose

    def move_to(self, T_world_camera):
        rows = [list(row) for row in T_world_camera]
        rows[0][3] += 1e-4
        self._pose = rows
        self.visited.append(rows[1][3])

    def picture(self) -> bytes:
        return b"picture"


def test_the_whole_cable_is_followed_to_both_ends():
    table, arm = Table(), Arm()
    result = Scan(table, arm).run()
    assert result.ended == ["the cable ends in view, or is hidden from there on"] * 2
    assert result.curve.length_m == pytest.approx(0.8)
    assert max(arm.visited) >= 0.3
    assert min(arm.visited) <= -0.3
    order = [section.result.curve.points_m[10][1] for section in result.sections]
    assert order == sorted(order)


def test_the_pose_reached_is_the_one_that_is_sent():
    table = Table()
    Scan(table, Arm(), ScanOptions(optimise="fixed", baseline_m=0.05)).run()
    views = table.requests[0].views
    assert [view.T_world_camera[0][3] for view in views] == pytest.approx([-0.0249, 0.0001, 0.0251])


def test_only_the_first_section_names_a_target():
    table = Table()
    Scan(table, Arm(), target_xy=(10.0, 20.0)).run()
    asked = [r for r in table.requests if isinstance(r, ReconstructRequest)]
    assert asked[0].target.xy == (10.0, 20.0)
    assert asked[0].previous is None
    assert all(r.target is None and r.previous is not None for r in asked[1:])


def test_with_fixed_poses_nothing_is_taken_twice():
    free, fixed = Table(), Table()
    Scan(free, Arm()).run()
    Scan(fixed, Arm(), ScanOptions(optimise="fixed")).run()
    count = [sum(isinstance(r, ReconstructRequest) for r in t.requests) for t in (free, fixed)]
    assert count[0] == count[1] + 1


def test_a_cable_that_is_lost_ends_the_scan_and_says_why():
    table = Table()
    table.lost_beyond = 0.15
    result = Scan(table, Arm()).run()
    assert result.ended == ["it was refused"] * 2
    assert 0.2 < result.curve.length_m < 0.8


def test_a_scan_is_bounded():
    result = Scan(Table(), Arm(), ScanOptions(at_most=1)).run()
    assert result.ended == ["after 1 sections"] * 2
    assert len(result.sections) == 3


class ArrayArm(Arm):
    """Knows its pose and its camera as arrays, and gives pixels."""

    intrinsics = Arm.intrinsics | {"distortion": np.zeros(5)}

    def pose(self):
        return np.asarray(super().pose())

    def picture(self):
        return np.zeros((480, 640, 3), np.uint8)


def test_an_arm_may_speak_in_arrays():
    result = Scan(Table(), ArrayArm()).run()
    assert result.curve.length_m == pytest.approx(0.8)


@pytest.mark.parametrize("views", [-1, 0, 1, 17])
def test_a_section_needs_two_pictures(views: int):
    """One ended in a division by zero after the arm had moved."""
    with pytest.raises(InvalidArgument, match=r"^views: "):
        ScanOptions(views=views)


def test_an_asynchronous_client_is_refused_by_name():
    with pytest.raises(InvalidArgument, match="Scan waits for answers: give it a Client"):
        Scan(AsyncClient("http://service"), Arm())


def test_an_arm_without_a_pose_is_refused():
    class Broken(Arm):
        def pose(self):
            return [[2.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]

    with pytest.raises(ValueError, match="orthonormal"):
        Scan(Table(), Broken()).run()


def test_a_curve_turned_twice_is_itself():
    curve = straight()
    assert reversed_curve(reversed_curve(curve)) == curve
    assert reversed_curve(curve).points_m[0] == curve.points_m[-1]


def test_the_picture_shows_the_cable_and_its_cameras():
    root = ET.fromstring(svg(straight(), [pose(0.0), pose(0.1)]))
    name = "{http://www.w3.org/2000/svg}"
    lines = root.findall(f"{name}polyline")
    assert len(lines) == 2
    xs = [float(pair.split(",")[0]) for pair in lines[0].get("points").split()]
    assert max(xs) - min(xs) > 500, "the cable's long direction lies to the right"
    assert len(root.findall(f"{name}path")) == 2 * 2 + 1
    above, side = (root.findall(f"{name}ellipse")[k] for k in (0, -1))
    upward, sideways = float(side.get("rx")), float(above.get("rx"))
    assert upward == pytest.approx(5 * sideways, rel=0.1), "1 mm upward, 0.2 mm sideways"
    assert float(above.get("ry")) == float(side.get("ry")) == 0, "none along the cable"


@pytest.fixture
def cameras(tmp_path: Path) -> list[Path]:
    views = [
        {"intrinsics": curve_samples.INTRINSICS.model_dump(), "T_world_camera": pose(x)}
        for x in (0.0, 0.1)
    ]
    paths = [tmp_path / name for name in ("row.json", "a.png", "b.png")]
    for path, data in zip(paths, (json.dumps(views).encode(), b"a", b"b"), strict=True):
        path.write_bytes(data)
    return paths


def test_dlo_reconstruct_saves_curve_and_picture(cameras: list[Path], tmp_path: Path):
    sent = []

    def network(request: httpx.Request) -> httpx.Response:
        if "/files/" in request.url.path:
            return httpx.Response(200, content=samples.OVERLAY)
        sent.append(request.read())
        return httpx.Response(200, text=curve_samples.job().model_dump_json())

    arguments = [
        "reconstruct",
        *map(str, cameras),
        "--out",
        str(tmp_path / "out"),
        "--target",
        "0",
        "320",
        "240",
    ]
    done = CliRunner().invoke(app, arguments, obj=httpx.MockTransport(network))
    assert done.exit_code == 0, done.output
    assert (
        "0.200 m, radius 2.00 mm, standard deviation 1.00 mm; reprojection 0.25 px" in done.stdout
    )
    assert "right: dropped, the DLO was not" in done.stdout
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {
        "row.result.json",
        "row.overlay_0.png",
        "row.svg",
    }
    assert sent[0].count(b'name="image"') == 2
    assert b'"target":{"view":0,"xy":[320.0,240.0]}' in sent[0]


def test_cameras_that_cannot_be_read_are_named(cameras: list[Path]):
    cameras[0].write_text("[{}]")
    done = CliRunner().invoke(
        app, ["reconstruct", *map(str, cameras)], obj=httpx.MockTransport(lambda _: None)
    )
    assert done.exit_code == 1
    assert "row.json" in done.stderr


@pytest.mark.parametrize("count", [0, 1])
def test_dlo_reconstruct_with_too_few_cameras_says_so(cameras: list[Path], count: int):
    """One camera was a traceback of pydantic's: only errors of the client ended in one line."""
    cameras[0].write_text(json.dumps(json.loads(cameras[0].read_text())[:count]))
    done = CliRunner().invoke(
        app, ["reconstruct", *map(str, cameras)], obj=httpx.MockTransport(lambda _: None)
    )
    assert done.exit_code == 1
    assert (
        done.stderr
        == f"error: views: List should have at least 2 items after validation, not {count}\n"
    )


@pytest.mark.parametrize(
    ("where", "message"), [("a.png", "No such file"), ("row.json", "No such file")]
)
def test_dlo_reconstruct_names_a_file_that_is_not_there(
    cameras: list[Path], where: str, message: str
):
    next(path for path in cameras if path.name == where).unlink()
    done = CliRunner().invoke(
        app, ["reconstruct", *map(str, cameras)], obj=httpx.MockTransport(lambda _: None)
    )
    assert done.exit_code == 1
    assert where in done.stderr
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(
    "arm", ["nothing", "nothing:at_all", ":made", ".here:made", "json:nothing", "json:loads"]
)
def test_dlo_scan_names_an_arm_that_is_none(arm: str, tmp_path: Path):
    done = CliRunner().invoke(app, ["scan", "--arm", arm, "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert done.stderr.startswith(f"error: --arm {arm}: ")


def test_dlo_scan_drives_an_arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "cell_arm.py").write_text(
        "import tests.clients.test_scan\n\n\ndef made():\n    return tests.clients.test_scan.Arm()\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        reconstruction_commands, "Scan", lambda client, arm, options: Scan(Table(), arm, options)
    )
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["scan", "--arm", "cell_arm:made", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "0.800 m" in done.stdout
    assert (out / "scan.svg").read_text().startswith("<svg")
    assert MergeCurvesResult.model_validate_json(
        (out / "scan.json").read_text()
    ).curve.length_m == pytest.approx(0.8)


@pytest.mark.parametrize("name", ["no_such_module:made", "json:no_such_name", "json"])
def test_an_arm_that_is_not_there_is_named(name: str, tmp_path: Path):
    done = CliRunner().invoke(app, ["scan", "--arm", name, "--out", str(tmp_path)])
    assert done.exit_code == 1
    assert name in done.stderr
