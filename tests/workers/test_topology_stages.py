"""``topology`` on real bytes and the shipped networks, and every bad input of its own."""

from __future__ import annotations

import numpy as np
import pytest
from dlo_client.contracts import (
    DisentangleRequest,
    DrawnBranch,
    HarnessDrawing,
    ImageRef,
    SeenPoint,
    TopologyRequest,
    TopologyResult,
)
from pydantic import ValidationError

from tests.workers.harness_pictures import depth_of, harness_mask, put
from workers import stages
from workers.settings import Settings
from workers.stages.outcome import InvalidInput, Tools


def run(tools: Tools, **fields) -> TopologyResult:
    return stages.run(TopologyRequest(**fields), tools).result


def test_a_warm_worker_has_the_topology_networks_loaded(tmp_path):
    loaded = stages.warm(Settings(data_dir=tmp_path, onnx_threads=1)).weights.loaded
    assert {
        "topology",
        "topology_junctions",
        "topology_bridges",
        "topology_stubs",
        "topology_moves",
    } <= set(loaded)


def test_the_whole_result_of_a_harness(tools):
    outcome = stages.run(
        TopologyRequest(mask=put(tools, harness_mask()), files=["overlay", "mask"]), tools
    )
    result = outcome.result
    assert isinstance(result, TopologyResult)
    assert TopologyResult.model_validate_json(result.model_dump_json()) == result
    assert (result.status, result.width, result.height) == ("branched", 400, 280)
    assert (len(result.sections), len(result.branch_points), len(result.crossings)) == (3, 1, 1)
    assert {m.name for m in result.models} == {
        "topology",
        "topology_junctions",
        "topology_bridges",
        "topology_stubs",
    }
    assert set(outcome.files) == {"overlay.png", "mask.png"}
    assert {"decode", "segment", "topology", "encode", "topology.graph"} <= set(outcome.timings_ms)
    count = len(result.nodes_xy)
    assert (
        len(result.node_angles_rad)
        == len(result.node_branch_scores)
        == len(result.node_crossing_scores)
        == count
    )
    assert all(e.a < e.b < count for e in result.edges)
    assert [s.id for s in result.sections] == [1, 2, 3]
    assert sorted(result.branch_points[0].sections) == [1, 2, 3]
    assert all(1 in s.branch_points for s in result.sections)


def test_a_picture_alone_is_segmented_first(tools):
    result = run(tools, image=put(tools, np.full((120, 160, 3), 90, np.uint8)))
    assert result.status == "empty"
    assert result.message
    assert {m.name for m in result.models} >= {"foreground_compact_int8", "topology"}


@pytest.mark.parametrize("upper_branch", [True, False])
def test_a_depth_map_orders_the_crossing(tools, upper_branch):
    result = run(tools, mask=put(tools, harness_mask()), depth=put(tools, depth_of(upper_branch)))
    (crossing,) = result.crossings
    thin = min(result.sections, key=lambda s: s.width_px)
    assert (crossing.over.section == thin.id) == upper_branch
    assert crossing.order_score > 0.6


def test_points_may_be_anywhere(tools):
    result = run(
        tools, mask=put(tools, harness_mask()), points=[SeenPoint(xy=(-900, 5), depth_m=1.0)]
    )
    assert result.crossings[0].order_score == 0.5


DRAWING = HarnessDrawing(
    unit="mm",
    branches=[
        DrawnBranch(name="stub", a="P", b="X1", length=80),
        DrawnBranch(name="trunk", a="P", b="X2", length=280),
        DrawnBranch(name="branch", a="P", b="X3", length=370),
        DrawnBranch(name="lost", a="X2", b="X4", length=50),
    ],
)


def test_a_drawing_names_the_sections(tools):
    result = run(tools, mask=put(tools, harness_mask()), drawing=DRAWING)
    assert result.match is not None
    assert result.match.missing == ["lost"]
    assert result.match.extra == []
    assert result.match.scale_from == "estimate"
    assert {s.name for s in result.sections} == {"stub", "trunk", "branch"}
    assert result.branch_points[0].name == "P"
    assert min(result.sections, key=lambda s: s.width_px).name == "branch"


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {
                "branches": [
                    {"name": "a", "a": "P", "b": "Q", "length": 1},
                    {"name": "b", "a": "Q", "b": "P", "length": 1},
                ]
            },
            "branches.*cycle",
        ),
        ({"branches": [{"name": "a", "a": "P", "b": "P", "length": 1}]}, "branches.*cycle"),
        ({"branches": [{"name": "a", "a": "P", "b": "Q", "length": 1}], "unit": "cubit"}, "unit"),
        ({"branches": [{"name": "a", "a": "P", "b": "Q", "length": 0}]}, "length"),
        (
            {
                "branches": [
                    {"name": "a", "a": "P", "b": "Q", "length": 1},
                    {"name": "a", "a": "Q", "b": "R", "length": 1},
                ]
            },
            "same name",
        ),
        (
            {
                "branches": [
                    {"name": "a", "a": "P", "b": "Q", "length": 1},
                    {"name": "b", "a": "R", "b": "S", "length": 1},
                ]
            },
            "several pieces",
        ),
        (
            {"branches": [{"name": "a", "a": "P", "b": "Q", "length": 1}], "connectors": ["Z"]},
            "connectors.*Z",
        ),
        ({"branches": []}, "branches"),
    ],
)
def test_a_drawing_that_cannot_be_is_refused(fields, message):
    with pytest.raises(ValidationError, match=rf"(?s){message}"):
        HarnessDrawing.model_validate(fields)


def test_sizes_have_to_agree(tools):
    small = np.zeros((10, 10), np.uint16)
    with pytest.raises(InvalidInput, match="depth") as caught:
        run(tools, mask=put(tools, harness_mask()), depth=put(tools, small))
    assert caught.value.code == "size_mismatch"


def test_a_depth_map_of_eight_bits_is_refused(tools):
    with pytest.raises(InvalidInput, match="16-bit"):
        run(tools, mask=put(tools, harness_mask()), depth=put(tools, harness_mask()))


def test_a_model_beside_a_mask_is_refused():
    with pytest.raises(ValidationError, match="`model` has no meaning"):
        TopologyRequest(mask=ImageRef(id="a" * 64), model="foreground_compact")


def test_noise_is_a_clear_answer(tools):
    noise = (np.random.default_rng(0).random((300, 400)) > 0.5).astype(np.uint8) * 255
    result = run(tools, mask=put(tools, noise))
    assert result.status == "too_complex"
    assert result.sections == []
    planned = stages.run(DisentangleRequest(mask=put(tools, noise)), tools).result
    assert planned.status == "no_crossing"


def test_a_harness_mask_sent_as_image_has_the_topology_of_the_mask(tools):
    """Segmented like a photograph, it had four branch-points where there is one."""
    picture = put(tools, harness_mask())
    as_mask = stages.run(TopologyRequest(mask=picture, files=[]), tools).result
    as_image = stages.run(TopologyRequest(image=picture, files=[]), tools).result
    assert len(as_mask.branch_points) > 0
    assert as_image.sections == as_mask.sections
    assert as_image.branch_points == as_mask.branch_points
    assert "taken as a mask" in as_image.warnings[0]
