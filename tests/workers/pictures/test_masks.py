"""Whatever is not background counts as cable, or the mask is refused with words that state what was
found."""

import io

import numpy as np
import pytest
from PIL import Image

from models.instances.drawing import palette
from tests.workers.pictures import drawn
from tests.workers.pictures.drawn import coded, indexed, read, saved, smooth
from workers.pictures.headers import PictureError
from workers.pictures.masks import foreground_of

ONE, TWO = drawn.crossed()
BOTH = ONE | TWO
IDS = np.where(TWO, 2, ONE.astype(np.uint8)).astype(np.uint8)
BLACK, RED, GREEN = (0, 0, 0), (255, 0, 0), (0, 255, 0)


def colored(ground=BLACK, first=RED, second=GREEN) -> np.ndarray:
    return np.array([ground, first, second], np.uint8)[IDS]


def with_alpha(color: np.ndarray, alpha: np.ndarray) -> np.ndarray:
    return np.dstack([color, alpha]).astype(np.uint8)


def blended(mask: np.ndarray, color: tuple[int, int, int]) -> np.ndarray:
    return (smooth(mask)[:, :, None] * color).astype(np.uint8)


SHARP = {
    "white": saved(np.uint8(255) * BOTH),
    "ones": saved(BOTH.astype(np.uint8)),
    "bilevel": saved(Image.fromarray(np.uint8(255) * BOTH).convert("1")),
    "ids": saved(IDS),
    "ids in 16 bits": saved(IDS.astype(np.uint16)),
    "ids of a thousand": saved(IDS.astype(np.uint16) * 1000),
    "ids in 32 bits": saved(IDS.astype(np.int32) * 1000, "TIFF"),
    "ids in floats": saved(IDS.astype(np.float32), "TIFF"),
    "ids that are light": saved(np.array([0, 60, 255], np.uint8)[IDS]),
    "ids from one": saved(IDS + np.uint8(1)),
    "inverted": saved(np.uint8(255) * ~BOTH),
    "inverted ids": saved(np.array([255, 1, 2], np.uint8)[IDS]),
    "palette": saved(indexed(IDS, [BLACK, (128, 0, 0), (0, 128, 0)])),
    "palette on white": saved(indexed(IDS, [(255, 255, 255), RED, BLACK])),
    "palette whose ground is its last index": saved(
        indexed(np.array([2, 0, 1], np.uint8)[IDS], [RED, GREEN, BLACK])
    ),
    "palette of one color": saved(indexed(IDS, [BLACK] * 3)),
    "GIF": saved(indexed(IDS, [BLACK, RED, GREEN]), "GIF"),
    "red and green": saved(colored()),
    "dark blue": saved(colored(BLACK, (0, 0, 64), (64, 0, 0))),
    "red on white": saved(colored((255, 255, 255), RED, RED)),
    "color in 16 bits": coded(colored().astype(np.uint16) * 257),
    "ids in 16-bit color": coded(colored(BLACK, (1, 1, 1), (2, 0, 0)).astype(np.uint16)),
    "BMP": saved(colored(), "BMP"),
    "TIFF": saved(colored(), "TIFF"),
    "WebP": saved(colored(), "WEBP", lossless=True),
    "16 bits, 0 and 255": saved(np.uint16(255) * BOTH),
    "16 bits, 0 and 4095": saved(np.uint16(4095) * BOTH),
    "transparency": saved(with_alpha(np.full((120, 160, 3), 255), 255 * BOTH)),
    "transparent ground": saved(with_alpha(colored((90, 80, 70)), 255 * BOTH)),
    "dark on transparent": saved(with_alpha(np.zeros((120, 160, 3)), 255 * BOTH)),
    "opaque in part": saved(
        with_alpha(colored(), np.where(np.arange(160) < 20, 0, 255) * np.ones((120, 1)))
    ),
    "gray and alpha": saved(
        Image.merge("LA", [Image.fromarray(np.uint8(255) * BOTH), Image.new("L", (160, 120), 9)])
    ),
}


@pytest.mark.parametrize("data", SHARP.values(), ids=SHARP)
def test_sharp_masks_give_exactly_what_is_not_background(data):
    """Indices, colors, 16 bits and transparency were read as gray of 8 bits against 128: nothing,
    or half of it."""
    foreground, _ = foreground_of(read(data))
    assert np.array_equal(foreground >= 0.5, BOTH)


SOFT = {
    "gray": saved((255 * smooth(BOTH)).astype(np.uint8)),
    "inverted": saved((255 - 255 * smooth(BOTH)).astype(np.uint8)),
    "16 bits to 255": saved((255 * smooth(BOTH)).astype(np.uint16)),
    "10 bits": saved((1023 * smooth(BOTH)).astype(np.uint16)),
    "16 bits": saved((65535 * smooth(BOTH)).astype(np.uint16)),
    "floats": saved(smooth(BOTH), "TIFF"),
    "floats to 255": saved(255 * smooth(BOTH), "TIFF"),
    "dim": saved((76 * smooth(BOTH)).astype(np.uint8)),
    "red": saved(blended(BOTH, RED)),
    "red and dark green": saved(blended(ONE, RED) + blended(TWO & ~ONE, (0, 80, 0))),
    "transparency": saved(with_alpha(np.full((120, 160, 3), 255), 255 * smooth(BOTH))),
    "JPEG": saved(np.uint8(255) * BOTH, "JPEG", quality=80),
    "JPEG in color": saved(colored(), "JPEG", quality=90),
    "lossy WebP": saved(colored(), "WEBP", quality=80),
}


@pytest.mark.parametrize("data", SOFT.values(), ids=SOFT)
def test_soft_masks_are_off_at_outlines_only(data):
    foreground, _ = foreground_of(read(data))
    found = foreground >= 0.5
    overlap = np.count_nonzero(found & BOTH) / np.count_nonzero(found | BOTH)
    assert overlap > 0.75


def test_a_probability_keeps_its_values():
    """The mask.png of an answer, sent back: where it is below a half it is no cable, however much
    there is of it."""
    ramp = np.zeros((60, 100), np.uint8)
    ramp[20:40] = np.linspace(0, 255, 100).astype(np.uint8)
    foreground, remarks = foreground_of(read(saved(ramp)))
    assert np.allclose(foreground, ramp / 255)
    assert remarks == []


def test_a_faint_probability_is_answered_with_a_remark():
    y, x = np.mgrid[:60, :100]
    faint = (60 * np.exp(-((x - 50) ** 2 / 800 + (y - 30) ** 2 / 200))).astype(np.uint8)
    foreground, remarks = foreground_of(read(saved(faint)))
    assert foreground.max() < 0.5
    assert "probability of 0.24 at most" in remarks[-1]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (SHARP["ids"], "0 as background"),
        (SHARP["ids"], "(2, 1)"),
        (SHARP["inverted"], "255 as background"),
        (SOFT["inverted"], "the dark was taken as cable"),
        (SHARP["red and green"], "RGB (255, 0, 0)"),
        (SHARP["transparency"], "in the transparency"),
        (SOFT["dim"], "areas of level 7"),
    ],
)
def test_what_was_taken_as_cable_is_stated(data, words):
    assert any(words in remark for remark in foreground_of(read(data))[1])


@pytest.mark.parametrize("name", ["white", "ones", "bilevel"])
def test_a_plain_mask_needs_no_remark(name):
    assert foreground_of(read(SHARP[name]))[1] == []


def test_nothing_but_background_is_an_empty_answer_with_a_remark():
    foreground, remarks = foreground_of(read(saved(np.zeros((20, 30), np.uint8))))
    assert not foreground.any()
    assert remarks == ["is 0 everywhere: it holds no cable"]


REFUSED = {
    "all white": (saved(np.full((20, 30), 255, np.uint8)), "255 everywhere"),
    "photograph": (saved(drawn.photograph()), "looks like a photograph"),
    "gray photograph": (saved(drawn.photograph()[:, :, 0]), "looks like a photograph"),
    "JPEG photograph": (saved(drawn.photograph(), "JPEG"), "looks like a photograph"),
    "negative": (saved(IDS.astype(np.float32) - 1, "TIFF"), "negative values"),
    "not finite": (saved(np.where(BOTH, np.nan, 0).astype(np.float32), "TIFF"), "not finite"),
}


@pytest.mark.parametrize(("data", "words"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_mask_is_refused_with_words(data, words):
    with pytest.raises(PictureError, match=words):
        foreground_of(read(data))


def test_the_undecided_rim_of_pascal_voc_is_no_cable():
    labels = np.where(BOTH, 1, 0).astype(np.uint8)
    labels[Image.new("L", (160, 120)).size[1] // 2, :20] = 255
    colors = [BLACK, (128, 0, 0), *[(0, 0, 0)] * 253, (224, 224, 192)]
    foreground, remarks = foreground_of(read(saved(indexed(labels, colors))))
    assert np.array_equal(foreground > 0, labels == 1)
    assert "undecided rim" in remarks[0]


def test_thin_lines_count_in_every_encoding():
    thin = drawn.curve(3, width=1)
    for data in (
        saved(thin.astype(np.uint8)),
        saved(np.uint8(255) * ~thin),
        saved(thin[:, :, None] * np.uint8(RED)),
    ):
        assert np.array_equal(foreground_of(read(data))[0] > 0, thin)
    assert (foreground_of(read(saved(blended(thin, RED))))[0][thin] > 0).mean() > 0.8


def test_own_instances_file_comes_back_whole():
    """The instances.png of an answer, sent back as `mask`, was read as gray: dark hues were
    lost."""
    picture = Image.fromarray(IDS, "P")
    picture.putpalette(palette().tobytes())
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    assert np.array_equal(foreground_of(read(buffer.getvalue()))[0] > 0, BOTH)
