"""The stages on real bytes and the shipped networks: every kind of picture, and one result
shape."""

from __future__ import annotations

import io
from pathlib import Path

import cv2
import numpy as np
import pytest
from dlo_client.contracts import (
    ImageRef,
    InstancesRequest,
    InstancesResult,
    NoopRequest,
    SegmentRequest,
)
from PIL import Image

from models.geometry import rle
from models.weights import inference
from workers import stages
from workers.settings import Settings
from workers.stages import first_use
from workers.stages.outcome import InvalidInput, Tools
from workers.stages.pictures import read_mask, read_picture

SAMPLES = Path(__file__).parents[1] / "samples"


def put(tools: Tools, picture: Image.Image, form: str = "PNG", **options) -> ImageRef:
    buffer = io.BytesIO()
    picture.save(buffer, form, **options)
    return ImageRef(id=tools.blobs.put(buffer.getvalue()))


def crossing_picture() -> np.ndarray:
    """A red bar over a green one on gray, 200 × 120, each 11 px wide."""
    image = np.full((120, 200, 3), 128, np.uint8)
    cv2.line(image, (20, 100), (180, 20), (30, 160, 40), 11)
    cv2.line(image, (20, 20), (180, 100), (200, 30, 30), 11)
    return image


def crossing_mask() -> np.ndarray:
    mask = np.zeros((120, 200), np.uint8)
    cv2.line(mask, (20, 100), (180, 20), 255, 11)
    cv2.line(mask, (20, 20), (180, 100), 255, 11)
    return mask


def test_every_default_network_is_loaded_before_the_first_job(tmp_path):
    """Nine of fifteen were listed as loaded and were not; the first plan took the time of three
    loads."""
    fresh = stages.warm(Settings(data_dir=tmp_path, onnx_threads=1))
    defaults = {spec.name for spec in inference.manifest().values() if spec.default}
    defaults.add(inference.eight_bit(inference.default_name("foreground")))
    assert set(fresh.weights.loaded) == defaults
    assert {network.name: network.warm for network in fresh.networks} == {
        name: name in defaults for name in inference.manifest()
    }


def test_a_child_has_used_before_the_first_job_what_is_slow_at_first(tools, tmp_path, monkeypatch):
    """The first picture took 190 ms longer than the second: it was the first one with a cable in
    it."""
    seen, harness, plan = first_use.use(tools)
    assert (
        len(seen.result.instances),
        len(seen.result.crossings),
        len(harness.result.crossings),
    ) == (2, 1, 1)
    assert all("overlay.png" in outcome.files for outcome in (seen, harness))
    assert plan.result.status.code == "ok"
    used = []
    monkeypatch.setattr(first_use, "use", used.append)
    assert used == [stages.warm(Settings(data_dir=tmp_path, onnx_threads=1))]


def test_noop_holds():
    assert stages.noop.run(NoopRequest(hold_s=0.01)).result.held_s == 0.01


@pytest.mark.parametrize(
    ("mode", "form", "color", "expected"),
    [
        ("RGB", "PNG", (10, 200, 30), (10, 200, 30)),
        ("RGB", "WEBP", (10, 200, 30), (10, 200, 30)),
        ("L", "PNG", 77, (77, 77, 77)),
        ("LA", "PNG", (77, 9), (77, 77, 77)),
        ("RGBA", "PNG", (10, 200, 30, 5), (10, 200, 30)),
        ("P", "PNG", 0, None),
        ("1", "PNG", 1, (255, 255, 255)),
        ("CMYK", "JPEG", (0, 0, 0, 0), (255, 255, 255)),
    ],
)
def test_every_color_mode_becomes_rgb(tools, mode, form, color, expected):
    options = {"lossless": True} if form == "WEBP" else {}
    image = read_picture(
        put(tools, Image.new(mode, (5, 4), color), form, **options), "image", tools
    ).rgb
    assert image.shape == (4, 5, 3)
    assert image.dtype == np.uint8
    if expected:
        assert np.abs(image[1, 1].astype(int) - expected).max() <= 2


def test_sixteen_bit_gray_keeps_its_upper_byte(tools):
    values = np.array([[0, 256, 0x8000, 0xFFFF]], np.uint16)
    image = read_picture(put(tools, Image.fromarray(values)), "image", tools).rgb
    assert image[0, :, 0].tolist() == [0, 1, 128, 255]


def test_sixteen_bit_color_is_read(tools):
    done, data = cv2.imencode(".png", np.full((4, 6, 3), 0x8000, np.uint16))
    assert done
    image = read_picture(ImageRef(id=tools.blobs.put(data.tobytes())), "image", tools).rgb
    assert image.shape == (4, 6, 3)
    assert abs(int(image[0, 0, 0]) - 128) <= 1


def test_exif_rotation_is_applied(tools):
    exif = Image.Exif()
    exif[0x0112] = 6  # the camera was turned: the upright picture is 10 wide, 20 high
    assert read_picture(
        put(tools, Image.new("RGB", (20, 10)), "JPEG", exif=exif), "image", tools
    ).rgb.shape == (
        20,
        10,
        3,
    )


@pytest.mark.parametrize("form", ["PNG", "JPEG"])
def test_a_truncated_picture_names_its_field(tools, form):
    buffer = io.BytesIO()
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3)).astype(np.uint8)
    Image.fromarray(noise).save(buffer, form)
    ref = ImageRef(id=tools.blobs.put(buffer.getvalue()[: len(buffer.getvalue()) // 2]))
    with pytest.raises(InvalidInput, match="decoded") as caught:
        read_picture(ref, "views.1.image", tools)
    assert caught.value.field == "views.1.image"


def test_too_many_pixels_are_refused_before_decoding(tools):
    small = Tools(tools.blobs, 100, tools.runtime, [])
    with pytest.raises(InvalidInput, match="limit is 100"):
        read_picture(put(tools, Image.new("L", (11, 10))), "image", small)


def test_expired_bytes_say_so(tools):
    with pytest.raises(InvalidInput, match="upload it again"):
        read_picture(ImageRef(id="0" * 64), "image", tools)


@pytest.mark.parametrize("white", [1, 255])
def test_a_mask_may_be_white_or_one(tools, white):
    mask = np.zeros((4, 4), np.uint8)
    mask[1] = white
    assert (
        read_mask(put(tools, Image.fromarray(mask)), "mask", tools)[0].tolist()
        == (mask / white).tolist()
    )


def test_a_wide_mask_keeps_its_scale(tools):
    values = np.array([[0, 0x8000, 0xFFFF]], np.uint16)
    found, _ = read_mask(put(tools, Image.fromarray(values)), "mask", tools)
    assert found[0].tolist() == pytest.approx([0.0, 0.5, 1.0], abs=1e-4)


def test_instances_from_mask_and_image(tools):
    request = InstancesRequest(
        image=put(tools, Image.fromarray(crossing_picture())),
        mask=put(tools, Image.fromarray(crossing_mask())),
        points_per_instance=33,
        files=["instances", "overlay", "mask"],
    )
    outcome = stages.run(request, tools)
    result = outcome.result
    assert isinstance(result, InstancesResult)
    assert [len(i.centerline_xy) for i in result.instances] == [33, 33]
    assert all(9 < i.width_px < 13 for i in result.instances)
    assert all([e.kind for e in i.endpoints] == ["free", "free"] for i in result.instances)
    (crossing,) = result.crossings
    assert crossing.xy == pytest.approx((100, 60), abs=3)
    over = next(i for i in result.instances if i.id == crossing.over.instance)
    (x0, y0), (x1, y1) = over.centerline_xy[0], over.centerline_xy[-1]
    assert (x1 - x0) * (y1 - y0) > 0, "the red bar, drawn last, falls to the right"
    assert crossing.score > 0.5
    labels = np.asarray(Image.open(io.BytesIO(outcome.files["instances.png"][1])))
    for instance in result.instances:
        assert np.array_equal(
            rle.decode(instance.mask_rle.counts, instance.mask_rle.size), labels == instance.id
        )
    assert set(outcome.files) == {"instances.png", "overlay.png", "mask.png"}
    assert {"decode", "instances", "encode"} <= set(outcome.timings_ms)


def test_a_mask_alone_gives_an_order_that_is_not_known(tools):
    request = InstancesRequest(mask=put(tools, Image.fromarray(crossing_mask())))
    outcome = stages.run(request, tools)
    assert len(outcome.result.instances) == 2
    assert [c.score for c in outcome.result.crossings] == [0.5]
    assert outcome.result.models == []


@pytest.mark.parametrize("method", ["section_matching", "rt_dlo", "fastdlo", "ariadne_plus"])
def test_what_is_unsure_gives_a_reason(tools, method):
    """Two clear bars of a mask, both ends of each in the picture, were ``unsure`` at 0.75 without
    any reason."""
    request = InstancesRequest(mask=put(tools, Image.fromarray(crossing_mask())), method=method)
    result = stages.run(request, tools).result
    unsure = [i for i in result.instances if i.score < result.status.limit]
    assert all(i.reasons for i in unsure)
    assert {reason for i in unsure for reason in i.reasons} <= set(result.status.reasons)
    assert "order" in result.status.reasons


@pytest.mark.parametrize(
    ("method", "networks"), [("section_matching", []), ("rt_dlo", ["rt_dlo_orientation"])]
)
def test_the_whole_chain_from_a_picture(tools, method, networks):
    image = put(tools, Image.fromarray(crossing_picture()))
    outcome = stages.run(InstancesRequest(image=image, method=method), tools)
    assert outcome.result.width == 200
    assert outcome.result.height == 120
    assert [m.name for m in outcome.result.models] == ["foreground_compact_int8", *networks]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effort", "suffix"), [("fast", "_int8"), ("normal", "_int8"), ("thorough", "")]
)
def test_every_effort_finds_cables(tools, effort, suffix):
    image = put(tools, Image.open(SAMPLES / "plain.jpg"))
    result = stages.instances.run(
        InstancesRequest(image=image, effort=effort, files=[]), tools
    ).result
    assert result.models[0].name == inference.default_name("foreground") + suffix
    assert len(result.instances) >= 3


def test_equal_requests_give_equal_bytes(tools):
    image = put(tools, Image.fromarray(crossing_picture()))
    mask = put(tools, Image.fromarray(crossing_mask()))
    first, again = (stages.run(InstancesRequest(image=image, mask=mask), tools) for _ in range(2))
    assert first.result.model_dump_json() == again.result.model_dump_json()
    assert first.files == again.files


@pytest.mark.parametrize("size", [(1, 1), (8000, 20), (20, 8000)])
def test_odd_sizes_are_answered(tools, size):
    result = stages.run(InstancesRequest(image=put(tools, Image.new("RGB", size))), tools).result
    assert (result.width, result.height) == size
    assert result.instances == []


def test_a_mask_of_another_size_is_refused(tools):
    request = InstancesRequest(
        image=put(tools, Image.new("RGB", (20, 10))), mask=put(tools, Image.new("L", (10, 20)))
    )
    with pytest.raises(InvalidInput) as caught:
        stages.run(request, tools)
    assert caught.value.field == "mask"
    assert "10 × 20" in caught.value.message


@pytest.mark.parametrize("model", ["nobody", "rt_dlo_orientation"])
def test_a_network_that_does_not_exist_or_fit_is_named(tools, model):
    request = SegmentRequest(image=put(tools, Image.new("RGB", (20, 10))), model=model)
    with pytest.raises(InvalidInput, match="foreground_compact") as caught:
        stages.run(request, tools)
    assert caught.value.field == "model"


def test_segment_reports_what_its_mask_shows(tools):
    request = SegmentRequest(image=put(tools, Image.fromarray(crossing_picture())), threshold=0.25)
    outcome = stages.run(request, tools)
    mask = np.asarray(Image.open(io.BytesIO(outcome.files["mask.png"][1])))
    assert mask.shape == (120, 200)
    assert outcome.result.threshold == 0.25
    assert outcome.result.coverage == pytest.approx(np.mean(mask >= 0.25 * 255), abs=0.01)


def test_a_mask_sent_as_image_is_taken_as_one(tools):
    """A black and white mask sent as `image` was segmented like a photograph."""
    image = put(tools, Image.fromarray(crossing_mask()))
    result = stages.run(InstancesRequest(image=image, files=[]), tools).result
    assert len(result.instances) == 2
    assert result.models == []
    assert "image: has two values only, so it was taken as a mask" in result.warnings[0]


def test_a_named_network_looks_at_every_picture_as_a_photograph(tools):
    image = put(tools, Image.fromarray(crossing_mask()))
    result = stages.run(
        InstancesRequest(image=image, model="foreground_compact", files=[]), tools
    ).result
    assert [m.name for m in result.models] == ["foreground_compact_int8"]
    assert not any("mask" in warning for warning in result.warnings)


def test_segment_answers_a_mask_with_itself(tools):
    outcome = stages.run(SegmentRequest(image=put(tools, Image.fromarray(crossing_mask()))), tools)
    mask = np.asarray(Image.open(io.BytesIO(outcome.files["mask.png"][1])))
    assert np.array_equal(mask > 0, crossing_mask() > 0)
    assert "taken as a mask" in outcome.result.warnings[0]


def test_remarks_name_their_field(tools):
    pages = [Image.fromarray(crossing_picture()), Image.fromarray(crossing_picture())]
    image = put(tools, pages[0], "TIFF", save_all=True, append_images=pages[1:])
    mask = put(tools, Image.fromarray(crossing_mask() // 255 * 2))
    warnings = stages.run(InstancesRequest(image=image, mask=mask, files=[]), tools).result.warnings
    assert [w.partition(" ")[0] for w in warnings] == ["image:", "mask:"]
    assert "has 2 pages" in warnings[0]


def test_the_overlay_of_a_large_picture_is_reduced(tools):
    """At 12 megapixels the overlay alone took up to three times as long as the rest of the job, and
    13 MB."""
    large = cv2.resize(crossing_mask(), (2000, 1200), interpolation=cv2.INTER_NEAREST)
    outcome = stages.run(InstancesRequest(mask=put(tools, Image.fromarray(large))), tools)
    overlay, labels = (
        Image.open(io.BytesIO(outcome.files[name][1])) for name in ("overlay.png", "instances.png")
    )
    assert (overlay.size, labels.size) == ((1000, 600), (2000, 1200))
    drawn = np.asarray(overlay)
    x, y = (round((v + 0.5) / 2 - 0.5) for v in outcome.result.instances[0].centerline_xy[20])
    assert np.ptp(drawn[y, x].astype(int)) > 60, (
        "the colored centerline is where the reduced mask is"
    )
    assert drawn[5, 5].max() < 8


def test_foreground_without_a_cable_is_named(tools):
    """A surface in a mask gave `none_found` and nothing else; a white mask is refused."""
    slab = np.zeros((360, 640), np.uint8)
    slab[60:300, 200:440] = 255
    result = stages.run(InstancesRequest(mask=put(tools, Image.fromarray(slab))), tools).result
    assert result.status.code == "none_found"
    assert any("25 % of the picture is foreground" in text for text in result.warnings)
    with pytest.raises(InvalidInput, match="255 everywhere"):
        stages.run(
            InstancesRequest(mask=put(tools, Image.fromarray(np.full_like(slab, 255)))), tools
        )
