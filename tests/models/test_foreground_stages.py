"""A Swin learns its stages from those of a ConvNeXt."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import pytest
import torch
from torch import Tensor

from models.training.foreground.campaign import CampaignParams
from models.training.foreground.learning import Learning, normalize
from models.training.foreground.network_convnext import ConvNeXt
from models.training.foreground.network_swin import Swin
from models.training.foreground.stages import Pair, learn, paired, shown, unexplained

pytestmark = [pytest.mark.slow, pytest.mark.no_cover]  # of training: nothing there is measured

TEACHER = "foreground_deeplab_convnext_t"


class Batches(NamedTuple):
    """Stands in for a mixture: the same pictures again and again."""

    images: Tensor

    def batch(self) -> tuple[Tensor, Tensor]:
        return self.images, torch.zeros(len(self.images), *self.images.shape[2:], dtype=torch.uint8)


def pictures() -> Tensor:
    """(2, 3, 64, 96) smooth stains."""
    coarse = torch.rand(2, 3, 8, 12, generator=torch.Generator().manual_seed(1)) * 255
    return torch.nn.functional.interpolate(coarse, scale_factor=8, mode="bilinear").byte()


@pytest.fixture
def pair() -> Pair:
    torch.manual_seed(0)
    return paired("deeplab_swin_t", 4, TEACHER, [normalize(pictures())])


def test_stem_and_decoder_are_the_teachers(pair: Pair) -> None:
    student, teacher = pair.student.eval(), pair.teacher
    assert isinstance(student.features, Swin)
    assert isinstance(teacher.features, ConvNeXt)
    x = normalize(pictures())
    torch.testing.assert_close(
        student.features.patch_embed(x), shown(teacher.features, x)[0], rtol=1e-4, atol=1e-4
    )
    low, high = teacher.features(x)
    torch.testing.assert_close(student.decoded(low, high), teacher.decoded(low, high))


def test_every_stage_comes_nearer_to_the_teachers(pair: Pair, tmp_path: Path) -> None:
    student, teacher = pair.student.features, pair.teacher.features
    assert isinstance(student, Swin)
    assert isinstance(teacher, ConvNeXt)
    seen = shown(teacher, normalize(pictures()))
    before = unexplained(student, seen).detach()
    params = CampaignParams(
        network="deeplab_swin_t", slim=4, minutes=0.05, rate=2e-3, decay=0.5, check_every=1.0
    )
    course = learn(pair, Batches(pictures()), params, tmp_path)  # type: ignore[arg-type]
    assert (unexplained(course.result().features, seen) < before).all()
    (line,) = [json.loads(text) for text in (tmp_path / "stages.jsonl").read_text().splitlines()]
    assert (line["step"], len(line["unexplained"])) == (course.steps, 4)
    begun = Learning("deeplab_swin_t", 4, params.config())
    begun.begin(None, tmp_path / "stages.pt", ())
    for own, learned in zip(begun.network.parameters(), course.result().parameters(), strict=True):
        torch.testing.assert_close(own, learned)


@pytest.mark.parametrize(
    ("network", "slim", "teacher", "match"),
    [
        ("deeplab_resnet50", 4, TEACHER, "network"),
        ("deeplab_swin_t", 4, "foreground_deeplab_resnet50", "teacher"),
        ("deeplab_swin_t", 8, TEACHER, "slim"),
    ],
)
def test_networks_of_other_kinds_and_widths_are_refused(
    network: str, slim: int, teacher: str, match: str
) -> None:
    with pytest.raises(ValueError, match=match):
        paired(network, slim, teacher, [normalize(pictures())])
