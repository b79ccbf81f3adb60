"""``reconstruct``, ``next_view`` and ``merge_curves`` on rendered pictures and the shipped
networks."""

from __future__ import annotations

import csv
import io

import cv2
import numpy as np
import pytest
from dlo_client.contracts import (
    CameraInfo,
    CameraPose,
    CameraView,
    ImageRef,
    MergeCurvesRequest,
    NextViewRequest,
    PinholeIntrinsics,
    ReconstructRequest,
    Target,
)

from models.geometry.cameras import Camera, Intrinsics
from models.reconstruction.curves import distances
from models.synthesis.arm import camera_above
from models.synthesis.views import Cable3D, Scene3D, noise_texture, random_cable, render
from workers import stages
from workers.stages.outcome import InvalidInput, Tools

RADIUS_M = 0.0018
ROW = [camera_above(np.array([x, 0.0]), 0.25) for x in (-0.03, -0.01, 0.01, 0.03)]


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    points = random_cable(np.random.default_rng(4), 0.4)
    return points - [*points[1000, :2], 0.0]


@pytest.fixture(scope="module")
def pictures(truth) -> list[np.ndarray]:
    """From ROW; the cable leaves them at the top and at the bottom. The last one shows the table
    alone."""
    rng = np.random.default_rng(7)
    table = noise_texture(rng)
    scene = Scene3D((Cable3D(truth, RADIUS_M, (0.8, 0.1, 0.1)),), table)
    return [render(scene, camera, rng).rgb for camera in ROW] + [
        render(Scene3D((), table), ROW[3], rng).rgb
    ]


def put(tools: Tools, rgb: np.ndarray) -> ImageRef:
    _, data = cv2.imencode(".png", rgb[:, :, ::-1])
    return ImageRef(id=tools.blobs.put(data.tobytes()))


def intrinsics(camera: Camera) -> PinholeIntrinsics:
    i = camera.intrinsics
    return PinholeIntrinsics(width=i.width, height=i.height, fx=i.fx, fy=i.fy, cx=i.cx, cy=i.cy)


def view(tools: Tools, rgb: np.ndarray, camera: Camera, name: str | None = None) -> CameraView:
    pose = camera.T_world_camera.tolist()
    return CameraView(
        image=put(tools, rgb), intrinsics=intrinsics(camera), T_world_camera=pose, name=name
    )


@pytest.fixture(scope="module")
def views(tools, pictures) -> list[CameraView]:
    return [view(tools, rgb, camera) for rgb, camera in zip(pictures, ROW, strict=False)]


@pytest.fixture(scope="module")
def outcome(tools, views):
    return stages.run(ReconstructRequest(views=views[:3]), tools)


def test_pictures_become_a_curve(outcome, truth):
    result = outcome.result
    error_mm = 1000 * distances(np.array(result.curve.points_m), truth)
    assert error_mm.mean() < 0.82
    assert result.reprojection_px < 0.73
    assert result.curve.radius_m == pytest.approx(RADIUS_M, rel=0.15)
    assert [v.status for v in result.views] == ["used"] * 3
    assert result.ends == ("border", "border")
    assert result.warnings == []
    assert len(result.curve.points_m) == len(result.curve.sigma_m) == 60


@pytest.mark.slow
def test_a_ros_camera_info_gives_the_same_curve(tools, views, outcome):
    """And the bent lens of one is not passed over."""
    i = ROW[0].intrinsics
    matrix = [i.fx, 0.0, i.cx, 0.0, i.fy, i.cy, 0.0, 0.0, 1.0]
    straight = CameraInfo(width=i.width, height=i.height, K=matrix, D=[0.0] * 5)
    bent = CameraInfo(width=i.width, height=i.height, K=matrix, D=[-0.2, 0.0, 0.0, 0.0, 0.0])
    curves = []
    for info in (straight, bent):
        asked = [v.model_copy(update={"intrinsics": info}) for v in views[:3]]
        curves.append(stages.run(ReconstructRequest(views=asked, files=[]), tools).result.curve)
    assert curves[0] == outcome.result.curve
    apart_mm = 1000 * distances(
        np.array(curves[1].points_m), np.array(outcome.result.curve.points_m)
    )
    assert apart_mm.max() > 1


def test_two_of_three_pictures_may_be_from_one_place(tools, views, truth):
    result = stages.run(
        ReconstructRequest(views=[views[0], views[0], views[2]], files=[]), tools
    ).result
    assert 1000 * distances(np.array(result.curve.points_m), truth).mean() < 0.82


def test_the_next_pictures_are_expected_to_be_better(outcome):
    plan = outcome.result.next_view
    assert plan.gain > 0.25
    assert plan.expected_sigma_m < plan.sigma_m
    assert len(plan.T_world_camera) == 3


def test_files_hold_the_same_curve(outcome):
    rows = list(csv.DictReader(io.StringIO(outcome.files["curve.csv"][1].decode())))
    points = np.array([[float(row[k]) for k in ("x_m", "y_m", "z_m")] for row in rows])
    assert points == pytest.approx(np.array(outcome.result.curve.points_m), abs=1e-6)
    lines = outcome.files["curve.ply"][1].decode().split("\n")
    assert lines[0] == "ply"
    assert "element vertex 60" in lines
    vertex = lines[lines.index("end_header") + 1].split()
    assert [float(v) for v in vertex[:3]] == pytest.approx(
        outcome.result.curve.points_m[0], abs=1e-6
    )
    assert {"overlay_0.png", "overlay_1.png", "overlay_2.png"} <= set(outcome.files)


def test_the_reprojection_is_drawn_over_the_cable(outcome, pictures, truth):
    _, data = outcome.files["overlay_1.png"]
    drawn = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    x, y = np.rint(ROW[1].project(truth[1000])).astype(int)
    assert np.abs(drawn[y, x].astype(int) - (255, 214, 10)).max() < 60


def test_equal_requests_give_equal_bytes(tools, views, outcome):
    again = stages.run(ReconstructRequest(views=views[:3]), tools)
    assert again.result.model_dump_json() == outcome.result.model_dump_json()
    assert again.files == outcome.files


def test_the_published_method_can_be_asked_for(tools, views, truth):
    result = stages.run(
        ReconstructRequest(views=views[:3], method="dlo3ds", files=[]), tools
    ).result
    assert result.method == "dlo3ds"
    assert 1000 * distances(np.array(result.curve.points_m), truth).mean() < 1.5


@pytest.mark.slow
def test_a_pixel_or_an_id_names_the_target(tools, views):
    x, y = ROW[1].project(np.array([0.0, 0.0, 0.01]))
    by_pixel = ReconstructRequest(
        views=views[:3], target=Target(view=1, xy=(float(x), float(y))), files=[]
    )
    by_id = ReconstructRequest(views=views[:3], target=Target(view=1, instance=1), files=[])
    found = [stages.run(request, tools).result for request in (by_pixel, by_id)]
    assert found[0].curve == found[1].curve


@pytest.mark.parametrize(
    ("target", "field"),
    [(Target(view=1, instance=9), "target.instance"), (Target(view=1, xy=(2.0, 2.0)), "target.xy")],
)
def test_a_target_that_is_not_there_is_named(tools, views, target, field):
    with pytest.raises(InvalidInput) as caught:
        stages.run(ReconstructRequest(views=views[:3], target=target), tools)
    assert caught.value.field == field


@pytest.mark.slow
def test_a_view_without_the_cable_is_dropped_by_name(tools, views, pictures):
    empty = view(tools, pictures[4], ROW[3], "left camera")
    result = stages.run(ReconstructRequest(views=[*views[:3], empty]), tools).result
    assert [v.status for v in result.views] == ["used", "used", "used", "dropped"]
    assert result.views[3].name == "left camera"
    assert "not found" in result.views[3].reason


def test_a_cable_in_one_view_only_fails_clearly(tools, views, pictures):
    others = [view(tools, pictures[4], camera) for camera in ROW[1:3]]
    with pytest.raises(InvalidInput, match=r"only in views\.0") as caught:
        stages.run(ReconstructRequest(views=[views[0], *others]), tools)
    assert caught.value.field == "views"


@pytest.mark.slow
def test_a_pose_wrong_by_five_centimeters_is_said(tools, pictures, truth):
    wrong = camera_above(np.array([0.08, 0.0]), 0.25)
    cameras = [*ROW[:3], wrong]
    views = [view(tools, rgb, camera) for rgb, camera in zip(pictures, cameras, strict=False)]
    result = stages.run(ReconstructRequest(views=views), tools).result
    assert [v.status for v in result.views] == ["used", "used", "used", "dropped"]
    assert "is the pose right" in result.views[3].reason
    assert "views.3" in result.warnings[0]
    assert 1000 * distances(np.array(result.curve.points_m), truth).mean() < 0.82


def test_two_views_say_that_they_cannot_check_each_other(tools, views):
    result = stages.run(ReconstructRequest(views=views[:2]), tools).result
    assert any("two views" in warning for warning in result.warnings)


@pytest.mark.slow
def test_cameras_that_look_the_other_way_fail_clearly(tools, pictures):
    """The cable would lie behind them."""
    swapped = [view(tools, rgb, camera) for rgb, camera in zip(pictures, ROW[2::-1], strict=False)]
    with pytest.raises(InvalidInput) as caught:
        stages.run(ReconstructRequest(views=swapped), tools)
    assert caught.value.field == "views"
    assert caught.value.code == "invalid_views"


def test_intrinsics_of_another_picture_are_refused(tools, views):
    other = views[0].model_copy(
        update={"intrinsics": views[0].intrinsics.model_copy(update={"width": 641})}
    )
    with pytest.raises(InvalidInput, match="641") as caught:
        stages.run(ReconstructRequest(views=[other, *views[1:3]]), tools)
    assert caught.value.field == "views.0.intrinsics"


@pytest.mark.slow
def test_a_scan_is_continued(tools, outcome, truth):
    """The cameras have moved 4 cm along the cable."""
    rng = np.random.default_rng(8)
    scene = Scene3D((Cable3D(truth, RADIUS_M, (0.8, 0.1, 0.1)),), noise_texture(rng))
    ahead = [camera_above(np.array([x, 0.05]), 0.25) for x in (-0.03, 0.0, 0.03)]
    views = [view(tools, render(scene, camera, rng).rgb, camera) for camera in ahead]
    result = stages.run(
        ReconstructRequest(views=views, previous=outcome.result.curve, files=[]), tools
    ).result
    assert 0.5 < result.overlap < 0.95
    first, last = result.curve.points_m[0], result.curve.points_m[-1]
    before = outcome.result.curve.points_m
    assert np.sign(last[1] - first[1]) == np.sign(before[-1][1] - before[0][1])
    merged = stages.run(MergeCurvesRequest(curves=[outcome.result.curve, result.curve]), tools)
    assert merged.result.curve.length_m > outcome.result.curve.length_m + 0.03
    assert 1000 * distances(np.array(merged.result.curve.points_m), truth).mean() < 0.82
    assert set(merged.files) == {"curve.ply", "curve.csv"}


def test_a_section_elsewhere_cannot_be_continued(tools, views, outcome):
    curve = outcome.result.curve
    away = curve.model_copy(
        update={
            "points_m": [(x + 2, y, z) for x, y, z in curve.points_m],
            "spline": curve.spline.model_copy(
                update={"control_m": [(x + 2, y, z) for x, y, z in curve.spline.control_m]}
            ),
        }
    )
    with pytest.raises(InvalidInput) as caught:
        stages.run(ReconstructRequest(views=views[:3], previous=away), tools)
    assert caught.value.field == "previous"
    with pytest.raises(InvalidInput) as caught:
        stages.run(MergeCurvesRequest(curves=[curve, away]), tools)
    assert caught.value.field == "curves.1"


def test_next_view_alone(tools, outcome):
    cameras = [
        CameraPose(intrinsics=intrinsics(c), T_world_camera=c.T_world_camera.tolist())
        for c in ROW[:3]
    ]
    request = NextViewRequest(
        curve=outcome.result.curve, cameras=cameras, pictures=4, nearest_m=0.2
    )
    plan = stages.run(request, tools).result.next_view
    assert len(plan.T_world_camera) == 4
    assert plan.delta_z_m < 0
    behind = cameras[0].model_copy(update={"T_world_camera": _lowered(cameras[0].T_world_camera)})
    with pytest.raises(InvalidInput, match="behind") as caught:
        stages.run(request.model_copy(update={"cameras": [behind]}), tools)
    assert caught.value.field == "cameras"


def _lowered(pose):
    return (*pose[:2], (*pose[2][:3], -1.0), pose[3])


@pytest.mark.slow
def test_a_large_picture_from_a_bent_lens(tools, truth):
    """Thresholds in pixels hold for a camera of 1600 × 1200, and the lens is undone."""
    lens = Intrinsics(1600, 1200, 1500.0, 1500.0, 799.5, 599.5, (-0.2, 0.06, 0.0, 0.0))
    cameras = [camera_above(np.array([x, 0.0]), 0.25, lens) for x in (-0.03, 0.03)]
    rng = np.random.default_rng(9)
    scene = Scene3D((Cable3D(truth, RADIUS_M, (0.8, 0.1, 0.1)),), noise_texture(rng))
    views = []
    for camera in cameras:
        made = view(tools, render(scene, camera, rng).rgb, camera)
        bent = made.intrinsics.model_copy(update={"distortion": list(lens.distortion)})
        views.append(made.model_copy(update={"intrinsics": bent}))
    x, y = cameras[1].project_to_picture(truth[1000:1001])[0]
    target = Target(view=1, xy=(float(x), float(y)))
    outcome = stages.run(ReconstructRequest(views=views, target=target), tools)
    error_mm = 1000 * distances(np.array(outcome.result.curve.points_m), truth)
    assert error_mm.mean() < 0.5
    assert [v.status for v in outcome.result.views] == ["used"] * 2
    drawn = cv2.imdecode(
        np.frombuffer(outcome.files["overlay_1.png"][1], np.uint8), cv2.IMREAD_COLOR
    )[:, :, ::-1]
    assert drawn.shape == (600, 800, 3), "reduced by two"
    column, row = (round((v + 0.5) / 2 - 0.5) for v in (x, y))
    assert np.abs(drawn[row, column].astype(int) - (255, 214, 10)).max() < 60


def test_one_picture_from_several_poses_is_refused(tools, views):
    """It put the DLO at infinity, without a word."""
    copied = [views[0], views[1].model_copy(update={"image": views[0].image})]
    with pytest.raises(InvalidInput, match="again") as caught:
        stages.run(ReconstructRequest(views=copied), tools)
    assert caught.value.field == "views.1.image"


def test_poses_in_millimeters_are_refused(tools, views):
    """They gave a cable of 277 m."""
    asked = []
    for given in views[:3]:
        pose = [[*row[:3], 1000 * row[3]] for row in given.T_world_camera[:3]] + [[0, 0, 0, 1]]
        asked.append(
            CameraView(image=given.image, intrinsics=given.intrinsics, T_world_camera=pose)
        )
    with pytest.raises(InvalidInput, match="millimeters") as caught:
        stages.run(ReconstructRequest(views=asked), tools)
    assert (caught.value.field, caught.value.code) == ("views", "invalid_scale")
