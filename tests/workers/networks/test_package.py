"""The file of a network: what is packed comes back, what is no such file is refused with the
reason."""

from __future__ import annotations

import io
import zipfile

import pytest

from tests.workers.networks import tiny
from workers.networks.package import PackageError, pack, unpack

MOST = 100_000


def archive(**members: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as made:
        for name, data in members.items():
            made.writestr(name.replace("__", "."), data)
    return out.getvalue()


def test_a_network_comes_back_from_its_file_and_the_file_is_always_the_same() -> None:
    onnx = tiny.brightness()
    card, back = unpack(tiny.packed(onnx), MOST)
    assert (card, back) == (tiny.card(onnx), onnx)
    assert pack(card, back) == tiny.packed(onnx)


CARD = tiny.card(tiny.brightness()).model_dump_json().encode()
BROKEN = {
    "no archive": (b"network", "is no network file"),
    "cut off": (tiny.packed()[:-30], "is no network file"),
    "without a card": (archive(network__onnx=tiny.brightness()), "holds no card.json"),
    "without weights": (archive(card__json=CARD), "holds no network.onnx"),
    "a card of another kind": (
        archive(card__json=b'{"name": "A B"}', network__onnx=b"x"),
        "card.json: name",
    ),
    "other weights": (
        archive(card__json=CARD, network__onnx=b"x"),
        "is not the file that card.json names",
    ),
    "too large": (
        archive(card__json=CARD, network__onnx=bytes(MOST + 1)),
        "more than 100000 bytes",
    ),
}


@pytest.mark.parametrize(("data", "why"), BROKEN.values(), ids=BROKEN)
def test_what_is_no_network_file_is_refused(data: bytes, why: str) -> None:
    with pytest.raises(PackageError, match=why):
        unpack(data, MOST)
