"""What decodes whole is accepted, what does not is refused."""

import numpy as np
import pytest

from tests.workers.pictures import drawn
from tests.workers.pictures.drawn import MOST, read, saved
from workers.pictures.headers import PictureError, inspect

END = b"\xff\xd9"
FORMS = {
    "sequential": {},
    "progressive": {"progressive": True},
    "restarts": {"restart_marker_blocks": 3},
    "gray": {},
    "full color": {"subsampling": 0},
}


def photo(form: str = "sequential", size: tuple[int, int] = (120, 160)) -> bytes:
    picture = drawn.photograph(size=size)
    return saved(picture[:, :, 0] if form == "gray" else picture, "JPEG", quality=90, **FORMS[form])


def accepted(data: bytes) -> bool:
    try:
        inspect(data, max_pixels=MOST)
        read(data)
    except PictureError as error:
        return "truncated JPEG" not in str(error)
    return True


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("share", [0.4, 0.7, 0.95])
def test_a_part_with_an_end_put_behind_it_is_refused(form, share):
    """Half a JPEG and FF D9 was accepted: the lower half came out gray."""
    whole = photo(form)
    assert accepted(whole)
    assert not accepted(whole[: int(share * len(whole))] + END)
    assert not accepted(whole[: int(share * len(whole))])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "trailer",
    [
        b"\0" * 50,
        b"\xff\xda" * 10,
        photo(),
        b"MotionPhoto_Data" + np.random.default_rng(0).bytes(50_000),
    ],
    ids=["zeros", "scan markers", "second picture", "video"],
)
def test_bytes_behind_the_end_do_not_matter(form, trailer):
    """A motion photo was refused as truncated: bytes of its video look like the start of a scan."""
    whole = photo(form)
    assert accepted(whole + trailer)
    assert np.array_equal(read(whole + trailer).values, read(whole).values)


def test_a_camera_that_leaves_out_the_end_marker_is_read():
    whole = photo()
    assert accepted(whole[:-2] + b"\x01" * 200 + b"SEFT")


@pytest.mark.parametrize("size", [(1, 1), (8, 8), (17, 9), (120, 161)])
@pytest.mark.parametrize("level", [0, 128, 255])
@pytest.mark.parametrize("progressive", [False, True])
def test_a_flat_picture_is_whole(size, level, progressive):
    """Its last block is as flat as one that libjpeg filled in."""
    flat = np.full((*size, 3), level, np.uint8)
    assert accepted(saved(flat, "JPEG", progressive=progressive))
