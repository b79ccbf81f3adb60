"""A network that somebody brings is tried before it may be named."""

from __future__ import annotations

from pathlib import Path

import pytest

from models.weights.foreign import UnfitNetworkError, fit_foreground
from models.weights.inference import WEIGHTS, manifest
from tests.workers.networks import tiny
from workers.stages.networks import spec_of


def check(data: bytes) -> None:
    fit_foreground(spec_of(tiny.card(data), "cell7", "1", len(data)), data)


def test_one_that_answers_as_it_should_is_fit() -> None:
    check(tiny.brightness())
    spec = manifest()["foreground_compact"]
    fit_foreground(spec, (WEIGHTS / spec.file).read_bytes())


UNFIT = {
    "no network": (b"network", "cannot be loaded"),
    "one channel": (tiny.brightness(inputs=1), r"its input is .* \(1, 3, H, W\) float32 is needed"),
    "two answers a pixel": (tiny.brightness(outputs=2), r"\(1, 1, 32, 32\) is needed"),
    "one size only": (tiny.brightness(sides=(64, 64)), "height and width have to be free"),
    "not finite": (tiny.brightness(float("nan")), "not finite"),
    "far from log odds": (tiny.brightness(1e7), "not finite, or far"),
}


@pytest.mark.parametrize(("data", "why"), UNFIT.values(), ids=UNFIT)
def test_one_that_is_not_fit_is_refused_with_the_reason(data: bytes, why: str) -> None:
    with pytest.raises(UnfitNetworkError, match=why):
        check(data)


def test_weights_in_files_of_this_machine_are_never_read(tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.write_bytes(bytes(12))
    for place in (str(secret), "secret", "../secret"):
        with pytest.raises(UnfitNetworkError, match="weights in other files"):
            check(tiny.with_outside_weights(place))
