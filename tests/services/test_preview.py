"""Previews: what a browser is shown of a picture that it cannot decode."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from services.preview import LONGEST_PX, preview
from tests.services import samples
from workers.pictures.headers import PictureError


def shown(data: bytes) -> np.ndarray:
    with Image.open(io.BytesIO(preview(data))) as image:
        assert (image.format, image.mode) == ("PNG", "RGB")
        return np.asarray(image)


@pytest.mark.parametrize("data", samples.ACCEPTED.values(), ids=samples.ACCEPTED)
def test_every_picture_that_is_taken_can_be_shown(data):
    assert shown(data).shape == (30, 40, 3)


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_gray_of_more_bits_is_scaled_by_what_it_uses(bits):
    """Dark 16-bit pictures of a 10- or 12-bit camera would be black."""
    values = np.linspace(0, 2**bits - 1, 256).astype(np.uint16)[None].repeat(4, 0)
    got = shown(samples.encoded(Image.fromarray(values), "TIFF"))[0, :, 0].astype(int)
    assert np.abs(got - np.arange(256)).max() <= 1


def test_floats_of_0_to_1_are_shown():
    values = np.linspace(0, 1, 256, dtype=np.float32)[None].repeat(4, 0)
    got = shown(samples.encoded(Image.fromarray(values), "TIFF"))[0, :, 0].astype(int)
    assert np.abs(got - np.arange(256)).max() <= 1


def test_a_preview_is_upright_and_small():
    turned = samples.encoded(samples.pixels(), "JPEG", orientation=samples.TURNED_RIGHT)
    assert shown(turned).shape == (40, 30, 3)
    assert shown(samples.encoded(samples.pixels(3 * LONGEST_PX, 30))).shape == (10, LONGEST_PX, 3)


@pytest.mark.parametrize("data", [b"", b"text", samples.encoded()[:-100]])
def test_what_is_no_picture_is_said_to_be_none(data):
    with pytest.raises(PictureError, match="cannot be decoded"):
        preview(data)


def test_an_uploaded_picture_is_shown(client, problem):
    image_id = client.post("/v1/images", content=samples.sixteen_bit_png()).json()["id"]
    answer = client.get(f"/v1/images/{image_id}/preview")
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "image/png"
    with Image.open(io.BytesIO(answer.content)) as image:
        assert (image.size, image.mode) == ((40, 30), "RGB")
    for unknown in ("0" * 64, "none"):
        problem(client.get(f"/v1/images/{unknown}/preview"), 404, "unknown_image")
