"""A student's encoder that is shown what its teacher's sees."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from models.training.foreground.learning import Learning
from models.training.state import Config

pytestmark = [pytest.mark.slow, pytest.mark.no_cover]  # of training: nothing there is measured

TEACHER = "foreground_compact"


def learning(network: str = "deeplab_convnext_t", **changes: float) -> Learning:
    settings = {"seed": 1, "minutes": 10.0, "batch": 2, "rate": 2e-3, "keep": 0.9, **changes}
    return Learning(network, 8, Config(**settings), hints=TEACHER)  # type: ignore[arg-type]


def batch() -> tuple[torch.Tensor, torch.Tensor]:
    """Two pictures of a bright bar, and its labels."""
    images = torch.full((2, 3, 64, 96), 60, dtype=torch.uint8)
    labels = torch.zeros(2, 64, 96, dtype=torch.uint8)
    images[:, :, 20:28], labels[:, 20:28] = 220, 255
    return images + torch.randint(
        0, 20, images.shape, generator=torch.Generator().manual_seed(0)
    ).byte(), labels


def unexplained(learning: Learning) -> float:
    assert learning.hints is not None
    x = torch.rand(2, 3, 64, 96, generator=torch.Generator().manual_seed(3))
    with torch.no_grad():
        return float(learning.hints(learning.hints.shown(x), *learning.network.features(x)))


@pytest.mark.parametrize("network", ["deeplab_resnet50", "deeplab_swin_t", "deeplab_convnext_t"])
def test_the_students_features_come_to_tell_the_teachers(network: str) -> None:
    student, told = learning(network), []
    hints = student.hints
    assert hints is not None
    hints.register_forward_hook(lambda _module, _inputs, out: told.append(float(out.detach())))
    taught = [p.clone() for p in hints._teacher[0].parameters()]
    student.network.train()
    for _ in range(12):
        student.step(*batch())
    assert 0.6 < told[0] < 2
    assert told[-1] < 0.8 * told[0]
    assert all(
        torch.equal(a, b) for a, b in zip(taught, hints._teacher[0].parameters(), strict=True)
    )


def test_in_the_end_only_what_is_answered_counts() -> None:
    late = learning()
    late.course.seconds = 600.0
    late.network.train()
    late.step(*batch())
    gradient = late.hints.low.weight.grad if late.hints else None
    assert gradient is not None
    assert not gradient.any()


def test_hints_go_on_where_a_training_ended(tmp_path: Path) -> None:
    first = learning()
    first.network.train()
    for _ in range(3):
        first.step(*batch())
    first.save(tmp_path / "last.pt", {})
    second = learning(seed=1)
    assert second.resume(tmp_path / "last.pt")
    second.network.train(first.network.training)
    assert unexplained(second) == pytest.approx(unexplained(first), rel=1e-5)


def test_a_student_without_the_places_for_hints_is_refused() -> None:
    with pytest.raises(ValueError, match="deeplab"):
        learning("compact")


def test_a_training_begun_without_hints_does_not_go_on_with_them(tmp_path: Path) -> None:
    """It failed for want of a key of the checkpoint."""
    config = Config(seed=1, minutes=10.0, batch=2, rate=2e-3, keep=0.9)
    Learning("deeplab_convnext_t", 8, config).save(tmp_path / "last.pt", {})
    with pytest.raises(ValueError, match="begun without --hints"):
        learning().resume(tmp_path / "last.pt")


def test_an_unknown_teacher_is_named() -> None:
    with pytest.raises(ValueError, match="'nobody'"):
        Learning("deeplab_convnext_t", 8, Config(minutes=1.0), hints="nobody")
