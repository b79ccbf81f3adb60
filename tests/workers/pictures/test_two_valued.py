"""A mask that was sent as a picture is recognised; a photograph is not."""

import cv2
import numpy as np
import pytest

from tests.workers.pictures import drawn
from tests.workers.pictures.drawn import read, saved, smooth
from workers.pictures.two_valued import why_a_mask

CURVE = drawn.curve()
WHITE = (255 * CURVE).astype(np.uint8)

MASKS = {
    "black and white": saved(WHITE),
    "inverted": saved(255 - WHITE),
    "smoothed": saved((255 * smooth(CURVE)).astype(np.uint8)),
    "as RGB": saved(np.repeat(WHITE[:, :, None], 3, axis=2)),
    "as JPEG": saved(WHITE, "JPEG", quality=95),
    "two grays": saved(np.where(CURVE, 200, 30).astype(np.uint8)),
    "ones": saved(CURVE.astype(np.uint8)),
    "16 bits": saved(np.uint16(65535) * CURVE),
    "colors on black": saved(np.uint8((0, 200, 50)) * CURVE[:, :, None]),
    "transparency": saved(np.dstack([np.zeros((120, 160, 3), np.uint8), WHITE])),
}


@pytest.mark.parametrize("data", MASKS.values(), ids=MASKS)
def test_masks_are_recognised(data):
    assert why_a_mask(read(data))


def drawing() -> np.ndarray:
    """Red and green bars on a gray ground, without noise."""
    picture = np.full((120, 160, 3), 128, np.uint8)
    cv2.line(picture, (10, 10), (150, 110), (200, 30, 30), 9)
    return picture


OTHERS = {
    "photograph": saved(drawn.photograph()),
    "gray photograph": saved(drawn.photograph()[:, :, 0]),
    "JPEG": saved(drawn.photograph(), "JPEG"),
    "drawing": saved(drawing()),
    "one color": saved(np.zeros((40, 50), np.uint8)),
    "dark photograph": saved(drawn.photograph() // 16),
    "high contrast": saved(
        np.clip(drawn.photograph()[:, :, 0].astype(int) * 4 - 300, 0, 255).astype(np.uint8)
    ),
}


@pytest.mark.parametrize("data", OTHERS.values(), ids=OTHERS)
def test_photographs_are_not(data):
    assert why_a_mask(read(data)) is None
