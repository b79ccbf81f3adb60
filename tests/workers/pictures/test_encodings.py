"""A curve in any encoding is found by `instances`, or refused with words: never silently
nothing."""

from __future__ import annotations

import numpy as np
import pytest
from dlo_client.contracts import ImageRef, InstancesRequest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from models.geometry import rle
from tests.workers.pictures import drawn
from workers import stages
from workers.stages.outcome import InvalidInput, Outcome, Tools

pytestmark = pytest.mark.slow
LEVELS = {
    np.uint8: [(0, 1), (0, 2), (0, 76), (0, 255), (255, 0), (1, 2), (30, 200), (255, 254), (7, 5)],
    np.uint16: [(0, 1), (0, 255), (0, 1023), (0, 40_000), (65_535, 0), (1000, 26_001)],
    np.int32: [(0, 3), (0, 26_001_000), (100_000, 0)],
    np.float32: [(0, 1), (1, 0), (0, 0.3), (0, 255), (2, 5)],
}
FORMS = {
    np.uint8: ["PNG", "TIFF", "BMP", "GIF", "WEBP", "JPEG"],
    np.uint16: ["PNG", "TIFF"],
    np.int32: ["TIFF"],
    np.float32: ["TIFF"],
}
COLORS = st.tuples(*[st.integers(0, 255)] * 3)


@st.composite
def gray(draw) -> tuple[np.ndarray, bytes, bool]:
    """The curve, a file that holds it in gray, and whether nothing was lost on the way."""
    curve = drawn.curve(draw(st.integers(0, 999)), draw(st.integers(4, 15)))
    kind = draw(st.sampled_from(list(LEVELS)))
    ground, cable = draw(st.sampled_from(LEVELS[kind]))
    form = draw(st.sampled_from(FORMS[kind]))
    soft = draw(st.booleans()) and abs(cable - ground) >= (0.3 if kind is np.float32 else 64)
    share = drawn.smooth(curve) if soft else curve.astype(float)
    options = {"quality": 90} if form == "JPEG" else {"lossless": True} if form == "WEBP" else {}
    data = drawn.saved((ground + (cable - ground) * share).astype(kind), form, **options)
    return curve, data, not soft and form != "JPEG"


def faint() -> tuple[np.ndarray, bytes, bool]:
    curve = drawn.curve(5, 4)
    return curve, drawn.saved((76 * drawn.smooth(curve)).astype(np.uint8)), False


@st.composite
def colored(draw) -> tuple[np.ndarray, bytes, bool]:
    """Likewise in color, as a palette, or in the transparency."""
    curve = drawn.curve(draw(st.integers(0, 999)), draw(st.integers(4, 15)))
    ground, cable = draw(COLORS), draw(COLORS)
    if max(abs(a - b) for a, b in zip(ground, cable, strict=True)) < 64:
        cable = tuple((value + 128) % 256 for value in ground)
    mode = draw(st.sampled_from(["RGB", "P", "RGBA", "JPEG"]))
    if mode == "P":
        return curve, drawn.saved(drawn.indexed(curve, [ground, cable])), True
    picture = np.where(curve[:, :, None], cable, ground).astype(np.uint8)
    if mode == "RGBA":
        return curve, drawn.saved(np.dstack([picture, 255 * curve]).astype(np.uint8)), True
    form = "JPEG" if mode == "JPEG" else draw(st.sampled_from(["PNG", "TIFF", "BMP"]))
    return curve, drawn.saved(picture, form), form != "JPEG"


def answered(request: InstancesRequest, tools: Tools) -> tuple[Outcome | None, InvalidInput | None]:
    try:
        return stages.run(request, tools), None
    except InvalidInput as error:
        return None, error


@settings(
    max_examples=120, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
)
@given(sent=gray() | colored())
def test_a_curve_as_mask_is_found_or_refused(tools, sent):
    """16 bits, indices, colors and transparency gave `none_found` without a word."""
    curve, data, exact = sent
    request = InstancesRequest(mask=ImageRef(id=tools.blobs.put(data)), files=[])
    if not exact:  # then the gate may refuse it, but not without words
        outcome, refusal = answered(request, tools)
        assert outcome or (refusal.field == "mask" and len(refusal.message) > 20)
        if outcome is None:
            return
    else:
        outcome = stages.run(request, tools)
    found = np.zeros_like(curve)
    for instance in outcome.result.instances:
        found |= rle.decode(instance.mask_rle.counts, instance.mask_rle.size).astype(bool)
    assert (found & curve).sum() > 0.6 * (found | curve).sum()


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@example(sent=faint())
@given(sent=gray())
def test_a_curve_as_image_is_found_or_there_is_a_warning(tools, sent):
    """A black and white mask sent as `image` was segmented like a photograph."""
    curve, data, _ = sent
    result = stages.run(
        InstancesRequest(image=ImageRef(id=tools.blobs.put(data)), files=[]), tools
    ).result
    assert result.instances or result.warnings
    if any("taken as a mask" in warning for warning in result.warnings):
        assert result.models == []
        if any("is a probability of" in warning for warning in result.warnings):
            return  # soft and faint, it may stay below the threshold all along
        found = sum(i.length_px * i.width_px for i in result.instances)
        assert 0.5 * curve.sum() < found < 2 * curve.sum()
