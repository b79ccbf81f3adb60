"""A foreground network that learns to compute in 8 bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

from models.training.foreground.initial import refold, unfold
from models.training.foreground.networks import build
from models.training.foreground.rounded import RoundedActivations, RoundedWeights, loss_of, rounded
from models.training.state import Config, Course
from models.weights.inference import WEIGHTS, manifest

pytestmark = [pytest.mark.slow, pytest.mark.no_cover]  # of training: nothing there is measured

FILE = WEIGHTS / manifest()["foreground_compact"].file


def test_weights_take_255_values_a_channel_and_pass_gradients_on() -> None:
    weights = torch.randn(3, 4, 5, 5, requires_grad=True)
    made = RoundedWeights()(weights)
    for channel, was in zip(made.detach(), weights.detach(), strict=True):
        steps = channel / (was.abs().max() / 127)
        assert torch.allclose(steps, steps.round(), atol=1e-3)
        assert (channel - was).abs().max() <= was.abs().max() / 254 + 1e-6
    made.sum().backward()
    assert weights.grad is not None
    assert torch.equal(weights.grad, torch.ones_like(weights))


def test_activations_take_256_values_with_zero_among_them() -> None:
    x = torch.linspace(-1.3, 4.7, 5000, requires_grad=True)
    made = RoundedActivations()(x)
    assert len(made.detach().unique()) <= 256
    assert (made.detach() == 0).any()
    assert (made - x).abs().max() < 6.0 / 255


def test_beyond_the_usual_range_nothing_passes() -> None:
    rounding = RoundedActivations()
    for _ in range(3):
        rounding(torch.linspace(0, 1, 100))
    x = torch.tensor([0.5, 3.0], requires_grad=True)
    made = rounding(x)
    assert made.detach()[1] < 1.1
    made.sum().backward()
    assert x.grad is not None
    assert x.grad.tolist() == [1.0, 0.0]


def test_a_rounded_network_comes_nearer_to_what_it_is_taught(tmp_path: Path) -> None:
    """And what it has learned is in a file that runs."""
    torch.manual_seed(0)
    teacher, network = build("compact", 1), build("compact", 1)
    for one in (teacher, network):
        unfold(FILE, one)
        one.eval()
    course = Course(rounded(network), Config(epochs=100, rate=1e-5, clip=1.0, weight_decay=0.0))
    images = torch.randint(0, 255, (2, 3, 64, 96), dtype=torch.uint8)
    losses = [course.step(loss_of(course.network, teacher, images)) for _ in range(8)]
    assert 0 < losses[-1] < 0.9 * losses[0]
    file = tmp_path / "rounded.onnx"
    file.write_bytes(refold(FILE, course.result()))
    session = onnxruntime.InferenceSession(file)
    seen = session.run(None, {session.get_inputs()[0].name: np.zeros((1, 3, 64, 64), np.float32)})[
        0
    ]
    assert seen.shape == (1, 1, 64, 64)
    assert np.isfinite(seen).all()
    with pytest.raises(ValueError, match="no features"):
        refold(FILE, torch.nn.Sequential(torch.nn.Conv2d(3, 3, 3)))
