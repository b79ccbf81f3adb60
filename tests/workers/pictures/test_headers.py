"""What an uploaded picture is, from its header alone."""

import resource

import cv2
import numpy as np
import pytest

from tests.services import samples
from workers.pictures.headers import PictureError, Size, inspect

MEGAPIXELS_64 = 64_000_000


@pytest.mark.parametrize("data", samples.ACCEPTED.values(), ids=samples.ACCEPTED)
def test_accepts_what_people_send(data):
    assert inspect(data, max_pixels=MEGAPIXELS_64) == Size(40, 30)


@pytest.mark.parametrize("data", samples.REFUSED.values(), ids=samples.REFUSED)
def test_refuses_what_is_no_whole_picture(data):
    with pytest.raises(PictureError):
        inspect(data, max_pixels=MEGAPIXELS_64)


@pytest.mark.parametrize("size", [(1, 1), (8000, 20), (20, 8000)])
def test_accepts_extreme_shapes(size):
    assert inspect(samples.encoded(samples.pixels(*size)), max_pixels=MEGAPIXELS_64) == Size(*size)


@pytest.mark.parametrize("format_name", ["JPEG", "PNG", "WEBP", "TIFF", "BMP"])
@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_size_is_that_of_the_picture_as_the_workers_decode_it(format_name, orientation):
    data = samples.encoded(format_name=format_name, orientation=orientation)
    height, width = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape[:2]
    assert inspect(data, max_pixels=MEGAPIXELS_64) == Size(width, height)


def test_orientation_behind_the_pixels_counts_too():
    data = samples.png_with_late_orientation()
    height, width = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape[:2]
    assert inspect(data, max_pixels=MEGAPIXELS_64) == Size(width, height) == Size(30, 40)


def test_pixel_limit_is_exact():
    data = samples.encoded(samples.pixels(40, 30))
    assert inspect(data, max_pixels=1200) == Size(40, 30)
    with pytest.raises(PictureError, match="1199"):
        inspect(data, max_pixels=1199)


def test_bomb_is_refused_by_its_header():
    """Nothing near its 500 megapixels is ever allocated."""
    data = samples.bomb()
    assert len(data) < 100_000
    before_kb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(PictureError, match="too many pixels"):
        inspect(data, max_pixels=MEGAPIXELS_64)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kb < 50_000


def test_jpeg_with_a_thumbnail_is_whole():
    assert inspect(samples.jpeg_with_thumbnail(), max_pixels=MEGAPIXELS_64) == Size(40, 30)
