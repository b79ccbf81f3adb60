"""``plan_shape`` from a picture of the table and a homography."""

from __future__ import annotations

import io

import cv2
import numpy as np
import pytest
from dlo_client.contracts import ImageRef
from PIL import Image

from tests.workers.planning_requests import line, run
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.table import to_table


def photograph() -> np.ndarray:
    """A yellow cable on gray, 640 × 360, 9 px wide, with a highlight."""
    rng = np.random.default_rng(0)
    image = np.clip(rng.normal(105, 4, (360, 640, 1)) + np.zeros(3), 0, 255).astype(np.uint8)
    x = np.linspace(120, 520, 80)
    points = np.column_stack([x, 180 + 40 * np.sin((x - 120) / 130)])
    for width, color in ((11, (120, 100, 10)), (8, (230, 200, 30)), (3, (255, 240, 150))):
        cv2.polylines(
            image, [np.rint(points * 16).astype(np.int32)], False, color, width, cv2.LINE_AA, 4
        )
    return image


def stored(tools: Tools, image: np.ndarray) -> ImageRef:
    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "PNG")
    return ImageRef(id=tools.blobs.put(buffer.getvalue()))


HOMOGRAPHY = ((0.001, 0, -0.32), (0, -0.001, 0.18), (0, 0, 1))


@pytest.mark.parametrize("order", [1, -1])
def test_a_picture_of_the_table_and_the_target_decides_the_order(tools, order):
    target = [(x, y + 0.05) for x, y in line(length=0.43)][::order]
    fields = {
        "state_m": None,
        "image": stored(tools, photograph()),
        "homography": HOMOGRAPHY,
        "target_m": target,
    }
    result = run(tools, **fields)
    assert result.status.code == "ok"
    first, last = np.array(result.state_m[0]), np.array(result.state_m[-1])
    assert np.sign(last[0] - first[0]) == order
    assert sorted([first[0], last[0]]) == pytest.approx([-0.2, 0.2], abs=0.02)
    assert "foreground_compact_int8" in {m.name for m in result.models}


@pytest.mark.parametrize(
    ("image", "homography", "field"),
    [
        (np.full((360, 640, 3), 105, np.uint8), HOMOGRAPHY, "image"),
        (photograph(), ((1, 0, 0), (2, 0, 0), (0, 0, 1)), "homography"),
        (photograph(), ((0.001, 0, 0), (0, 0.001, 0), (1, 0, -300)), "homography"),
    ],
)
def test_a_picture_that_shows_no_dlo_on_the_table(tools, image, homography, field):
    with pytest.raises(InvalidInput) as caught:
        run(tools, state_m=None, image=stored(tools, image), homography=homography)
    assert caught.value.field == field


def test_a_picture_is_missing(tools):
    with pytest.raises(InvalidInput, match="image"):
        run(tools, state_m=None, homography=HOMOGRAPHY)


@pytest.mark.parametrize("factor", [1e-4, -1.0, 1e6])
def test_the_scale_of_a_homography_is_free(factor):
    """1e-4 times a valid one was refused as singular."""
    xy, homography = np.array([[100.0, 50.0], [500.0, 300.0]]), np.array(HOMOGRAPHY)
    assert to_table(xy, factor * homography) == pytest.approx(to_table(xy, homography))


@pytest.mark.parametrize(
    ("homography", "said"),
    [
        (
            np.linalg.inv(np.array([[0.001, 0, -0.32], [0, 0.001, -0.18], [0, 0, 1.0]])),
            "its inverse is needed",
        ),
        (np.array([[1.0, 0, -320], [0, 1.0, -180], [0, 0, 1.0]]), "millimeters"),
        (np.array([[0.1, 0, -32], [0, 0.1, -18], [0, 0, 1.0]]), "centimeters"),
    ],
)
def test_a_homography_to_another_unit_or_of_the_other_direction_is_refused(tools, homography, said):
    """An inverse one moved the gripper by 82 km."""
    picture = stored(tools, photograph())
    with pytest.raises(InvalidInput, match=said) as caught:
        run(
            tools,
            state_m=None,
            image=picture,
            homography=homography.tolist(),
            target_m=line(length=0.43),
        )
    assert caught.value.field == "homography"
