"""``instances`` and ``topology`` with a depth map: as PNG, as TIFF, with a mask, alone; what is
refused."""

from __future__ import annotations

import io

import numpy as np
import pytest
from dlo_client.contracts import (
    ImageRef,
    InstancesRequest,
    InstancesResult,
    PinholeIntrinsics,
    TopologyRequest,
)
from PIL import Image
from pydantic import ValidationError

from models.synthesis.depth_scenes import DepthScene, DepthSceneParams, depth_scene
from models.synthesis.depth_sensor import SensorParams, sensed
from models.weights.inference import Runtime
from workers.blobs import FolderBlobs
from workers.stages import instances
from workers.stages.depth import curve_fields, plane, read_depth
from workers.stages.outcome import InvalidInput, Tools

PARAMS = DepthSceneParams(size=(240, 320), focal_px=450.0, radius_m=0.0025, cables=2)
INTRINSICS = PinholeIntrinsics(width=320, height=240, fx=450.0, fy=450.0, cx=159.5, cy=119.5)


@pytest.fixture(scope="module")
def tools(tmp_path_factory) -> Tools:
    blobs = FolderBlobs(tmp_path_factory.mktemp("blobs"), 3600.0)
    return Tools(blobs, 1_000_000, Runtime(["CPUExecutionProvider"], 1, spinning=False))


@pytest.fixture(scope="module")
def scene() -> DepthScene:
    return depth_scene(np.random.default_rng(3), PARAMS)


@pytest.fixture(scope="module")
def noisy(scene: DepthScene) -> np.ndarray:
    return sensed(np.random.default_rng(4), scene.depth_m, SensorParams())


def put(tools: Tools, values: np.ndarray, form: str = "PNG") -> ImageRef:
    buffer = io.BytesIO()
    Image.fromarray(values).save(buffer, form)
    return ImageRef(id=tools.blobs.put(buffer.getvalue()))


def millimeters(tools: Tools, depth_m: np.ndarray) -> ImageRef:
    return put(tools, np.rint(np.nan_to_num(depth_m) * 1000).astype(np.uint16))


def look(tools: Tools, **fields: object) -> InstancesResult:
    request = InstancesRequest.model_validate({"intrinsics": INTRINSICS, "files": []} | fields)
    result = instances.run(request, tools).result
    return InstancesResult.model_validate_json(result.model_dump_json())


def off(curve: list[tuple[float, float, float]], true: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.array(curve)[:, None] - true[None], axis=2).min(1)


def check(result: InstancesResult, scene: DepthScene, most_m: float) -> None:
    assert result.table is not None
    assert np.array(result.table.normal) @ scene.table[0] > 0.9999
    assert result.table.offset_m == pytest.approx(scene.table[1], abs=0.002)
    long = [item for item in result.instances if item.length_px > 100]
    assert len(long) == 2
    for item in long:
        assert item.curve_m is not None
        assert (
            len(item.curve_m)
            == len(item.centerline_xy)
            == len(item.sigma_m)
            == len(item.covariance_m2)
        )
        assert min(float(np.mean(off(item.curve_m, true))) for true in scene.curves_m) < most_m
        assert item.radius_m == pytest.approx(PARAMS.radius_m, rel=0.4)


def test_floats_beside_a_mask(tools, scene, noisy):
    """Holes are NaN in it, as sensors write them."""
    assert np.isnan(noisy).any()
    mask = put(tools, scene.mask.astype(np.uint8) * 255)
    check(look(tools, mask=mask, depth=put(tools, noisy, "TIFF")), scene, 0.0015)


def test_depth_alone_in_millimeters(tools, scene, noisy):
    check(look(tools, depth=millimeters(tools, noisy)), scene, 0.002)


def test_the_camera_moves_the_curves_into_the_world(tools, scene, noisy):
    pose = (
        (0.0, -1.0, 0.0, 0.3),
        (1.0, 0.0, 0.0, -0.2),
        (0.0, 0.0, 1.0, 1.0),
        (0.0, 0.0, 0.0, 1.0),
    )
    mask = put(tools, scene.mask.astype(np.uint8) * 255)
    depth = put(tools, noisy, "TIFF")
    here, there = (
        look(tools, mask=mask, depth=depth),
        look(tools, mask=mask, depth=depth, T_world_camera=pose),
    )
    transform = np.array(pose)
    for a, b in zip(here.instances, there.instances, strict=True):
        moved = np.array(a.curve_m) @ transform[:3, :3].T + transform[:3, 3]
        assert np.abs(moved - np.array(b.curve_m)).max() < 0.0005
        assert np.allclose(a.sigma_m, b.sigma_m, rtol=0.05)
    assert np.array(there.table.normal) == pytest.approx(
        transform[:3, :3] @ np.array(here.table.normal), abs=1e-3
    )


def test_points_per_instance_counts_for_both(tools, scene, noisy):
    mask = put(tools, scene.mask.astype(np.uint8) * 255)
    result = look(tools, mask=mask, depth=put(tools, noisy, "TIFF"), points_per_instance=17)
    assert {len(item.curve_m) for item in result.instances if item.curve_m} == {17}


def test_without_a_table_a_mask_still_has_its_curves(tools, scene):
    wall = np.random.default_rng(0).uniform(0.3, 3.0, (240, 320)).astype(np.float32)
    wall[scene.mask] = 0.5
    result = look(
        tools, mask=put(tools, scene.mask.astype(np.uint8) * 255), depth=put(tools, wall, "TIFF")
    )
    assert result.table is None
    assert any("no table" in warning for warning in result.warnings)
    assert all(item.curve_m for item in result.instances)


def test_depth_alone_without_a_table_is_refused(tools):
    wall = np.random.default_rng(0).uniform(0.3, 3.0, (240, 320)).astype(np.float32)
    with pytest.raises(InvalidInput) as refused:
        look(tools, depth=put(tools, wall, "TIFF"))
    assert refused.value.field == "depth"


@pytest.mark.parametrize("kind", ["8 bit", "color", "millimeters as floats", "size", "camera"])
def test_depths_that_are_none_are_refused(tools, scene, kind):
    values = {
        "8 bit": np.full((240, 320), 7, np.uint8),
        "color": np.dstack([np.full((240, 320), k, np.uint8) for k in (7, 8, 9)]),
        "millimeters as floats": np.full((240, 320), 600.0, np.float32),
        "size": np.full((120, 160), 0.6, np.float32),
        "camera": np.full((240, 320), 0.6, np.float32),
    }[kind]
    camera = INTRINSICS.model_copy(update={"width": 640 if kind == "camera" else INTRINSICS.width})
    mask = put(tools, scene.mask.astype(np.uint8) * 255)
    form = "TIFF" if values.dtype == np.float32 else "PNG"
    with pytest.raises(InvalidInput) as refused:
        look(tools, mask=mask, depth=put(tools, values, form), intrinsics=camera)
    assert refused.value.field == ("intrinsics" if kind in ("camera", "size") else "depth")


def test_depth_needs_a_camera(tools):
    with pytest.raises(ValidationError, match="intrinsics"):
        InstancesRequest(depth=ImageRef(id="0" * 64))


def test_without_depth_nothing_is_metric(tools, scene):
    result = look(tools, mask=put(tools, scene.mask.astype(np.uint8) * 255), intrinsics=None)
    assert result.table is None
    assert all(item.curve_m is None and item.sigma_m is None for item in result.instances)
    assert curve_fields(None, np.zeros((5, 2)), 3.0, [], 5) == {}
    assert plane(read_depth(InstancesRequest(), tools)) is None


def cloud_of(tools: Tools, depth_m: np.ndarray, turned: bool = False) -> ImageRef:
    """A point for every pixel, as an NPY file; ``turned``: in another frame than the camera's."""
    row, column = np.mgrid[:240, :320]
    points = np.dstack([(column - 159.5) / 450 * depth_m, (row - 119.5) / 450 * depth_m, depth_m])
    points = (
        points @ np.array([[0.0, 1.0, 0.0], [0.6, 0.0, 0.8], [0.8, 0.0, -0.6]]) + 1
        if turned
        else points
    )
    file = io.BytesIO()
    np.save(file, points.astype(np.float32))
    return ImageRef(id=tools.blobs.put(file.getvalue()))


def test_a_point_cloud_beside_a_mask_and_alone(tools, scene, noisy):
    mask = put(tools, scene.mask.astype(np.uint8) * 255)
    check(look(tools, mask=mask, depth=cloud_of(tools, noisy)), scene, 0.0015)
    check(look(tools, depth=cloud_of(tools, noisy)), scene, 0.002)


def test_the_camera_of_a_point_cloud_follows_from_its_points(tools, noisy):
    seen = read_depth(TopologyRequest(depth=cloud_of(tools, noisy)), tools)
    assert seen is not None
    assert seen.camera is not None
    assert seen.table is not None
    assert (seen.camera.intrinsics.fx, seen.camera.intrinsics.cx) == pytest.approx(
        (450.0, 159.5), abs=0.05
    )


@pytest.mark.parametrize("given", [True, False])
def test_a_point_cloud_in_another_frame_is_refused(tools, noisy, given):
    request = TopologyRequest(
        depth=cloud_of(tools, noisy, turned=True), intrinsics=INTRINSICS if given else None
    )
    with pytest.raises(InvalidInput, match="camera's frame") as refused:
        read_depth(request, tools)
    assert refused.value.field == "depth"


@pytest.mark.parametrize("factor", [1000.0, -1.0])
def test_points_in_millimeters_or_behind_the_camera_are_refused(tools, noisy, factor):
    with pytest.raises(InvalidInput, match=r"meters|before the camera") as refused:
        read_depth(TopologyRequest(depth=cloud_of(tools, factor * noisy)), tools)
    assert refused.value.field == "depth"


def test_a_damaged_point_cloud_names_the_field(tools):
    with pytest.raises(InvalidInput, match="damaged") as refused:
        read_depth(TopologyRequest(depth=ImageRef(id=tools.blobs.put(b"\x93NUMPY what"))), tools)
    assert refused.value.field == "depth"
