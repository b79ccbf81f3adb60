"""Polygons of a request say where cables can be, and where they never are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from dlo_client.contracts import ImageRef, InstancesRequest, TopologyRequest
from dlo_client.contracts.foreground import Regions
from PIL import Image

from models.instances import section_matching
from models.instances.settling import Settled
from tests.workers.test_stages import put
from workers import stages
from workers.stages import foreground, perception
from workers.stages.outcome import InvalidInput
from workers.stages.regions import within

HIGH = [(0.0, 0.0), (200.0, 0.0), (200.0, 60.0), (0.0, 60.0)]
LOW = [(0.0, 60.0), (200.0, 60.0), (200.0, 120.0), (0.0, 120.0)]
EVERYTHING = [(-9.0, -9.0), (300.0, -9.0), (300.0, 300.0), (-9.0, 300.0)]


@pytest.fixture(scope="module")
def two_bars(tools) -> ImageRef:
    """Level bars at y 30 and 90 of a mask of 200 × 120."""
    mask = np.zeros((120, 200), np.uint8)
    for y in (30, 90):
        cv2.line(mask, (20, y), (180, y), 255, 9)
    return put(tools, Image.fromarray(mask))


@pytest.mark.parametrize(
    ("regions", "seen"),
    [
        (None, [30, 90]),
        (Regions(only=[HIGH]), [30]),
        (Regions(never=[HIGH]), [90]),
        (Regions(only=[HIGH, LOW]), [30, 90]),
        (Regions(only=[EVERYTHING], never=[LOW]), [30]),
    ],
)
def test_cables_are_found_where_they_can_be(tools, two_bars, regions, seen):
    request = InstancesRequest(mask=two_bars, regions=regions)
    found = stages.run(request, tools).result.instances
    assert sorted(round(np.mean([y for _, y in i.centerline_xy])) for i in found) == pytest.approx(
        seen, abs=1
    )


def test_a_harness_is_read_within_the_regions(tools, two_bars):
    result = stages.run(TopologyRequest(mask=two_bars, regions=Regions(never=[LOW])), tools).result
    assert len(result.sections) == 1


def test_regions_that_leave_nothing_are_named(tools, two_bars):
    request = InstancesRequest(mask=two_bars, regions=Regions(only=[HIGH], never=[EVERYTHING]))
    with pytest.raises(InvalidInput, match="leave no pixel"):
        stages.run(request, tools)


def test_what_is_within_keeps_its_probability():
    seen = np.full((120, 200), 0.7, np.float32)
    kept = within(Regions(only=[[(50, 20), (99, 20), (99, 79), (50, 79)]]), seen)
    assert np.array_equal(np.argwhere(kept)[[0, -1]], [[20, 50], [79, 99]])
    assert set(np.unique(kept)) == {np.float32(0), np.float32(0.7)}


def test_what_a_cable_is_continued_by_ends_where_the_regions_end(tools, monkeypatch):
    """The scene of a settled foreground was answered although a part of it lay outside the
    regions."""
    picture = np.full((120, 200, 3), 90, np.uint8)
    bars = np.zeros((120, 200), bool)
    bars[26:35, 20:180] = bars[86:95, 20:180] = True

    def settle(image, probability, cable, threshold):
        scene = section_matching.extract(bars, image)
        return Settled(bars, np.where(bars, np.float32(0.9), np.float32(0.1)), scene)

    monkeypatch.setattr(foreground, "settle", settle)
    monkeypatch.setattr(perception, "without_lookalikes", lambda scene, *seen: scene)
    request = InstancesRequest(
        image=put(tools, Image.fromarray(picture)), regions=Regions(only=[HIGH])
    )
    (cable,) = stages.run(request, tools).result.instances
    assert np.mean([y for _, y in cable.centerline_xy]) == pytest.approx(30, abs=1)
