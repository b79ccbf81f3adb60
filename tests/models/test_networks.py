"""The DeepLabV3+ family: published sizes, the forward contract, Swin's windows, export, and
training by name."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor, nn

from models.training import export as exporting
from models.training.export import export
from models.training.foreground.export import SIZES, dynamic_sides
from models.training.foreground.learning import Learning
from models.training.foreground.network_convnext import ConvNeXt
from models.training.foreground.network_deeplab import DeepLab, Encoder
from models.training.foreground.network_resnet import ResNet
from models.training.foreground.network_swin import (
    Swin,
    WindowAttention,
    _turned,
    from_windows,
    relative_index,
    to_windows,
)
from models.training.foreground.networks import NETWORKS, build
from models.training.state import Config
from models.weights.inference import Card, manifest

pytestmark = [pytest.mark.slow, pytest.mark.no_cover]  # of training: nothing there is measured

PUBLISHED_MILLIONS = {  # without classifier
    "deeplab_resnet50": 23.5,
    "deeplab_resnet101": 42.5,
    "deeplab_swin_t": 27.5,
    "deeplab_swin_s": 48.8,
    "deeplab_convnext_t": 27.8,
    "deeplab_convnext_s": 49.5,
}
TINY: dict[str, Encoder] = {
    "resnet": ResNet((1, 1, 1, 2), 4),
    "swin": Swin((1, 0, 0, 2), 12),
    "convnext": ConvNeXt((1, 1, 1, 1), 8),
}


def lively(encoder: Encoder) -> DeepLab:
    """A tiny network whose every part shows in the output (fresh ones are nearly constant:
    ``gamma`` is 1e-6)."""
    network = DeepLab(encoder, 16, 8)
    generator = torch.Generator().manual_seed(0)
    for name, parameter in network.named_parameters():
        if parameter.ndim > 1:
            fan_in = parameter[0].numel()
            nn.init.normal_(parameter, std=min((2 / fan_in) ** 0.5, 1.0), generator=generator)
        elif name.endswith("gamma"):
            nn.init.ones_(parameter)
    return network.eval()


def pictures(count: int, height: int, width: int) -> Tensor:
    return torch.randn(count, 3, height, width, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize(("name", "millions"), PUBLISHED_MILLIONS.items())
def test_encoder_has_the_published_number_of_parameters(name, millions):
    with torch.device("meta"):
        network = build(name)
    assert sum(p.numel() for p in network.features.parameters()) == pytest.approx(
        millions * 1e6, rel=0.01
    )


@pytest.mark.parametrize("name", NETWORKS)
def test_every_network_answers_at_the_size_of_its_input(name):
    network = build(name, 8).eval()
    with torch.no_grad():
        assert network(pictures(1, 64, 96)).shape == (1, 1, 64, 96)


def test_unknown_names_and_widths_are_refused():
    with pytest.raises(ValueError, match="deeplab_swin_t"):
        build("unet")
    with pytest.raises(ValueError, match="slim"):
        build("deeplab_swin_t", 3)


@pytest.mark.parametrize("kind", TINY)
def test_batched_equals_one_by_one(kind):
    network, x = lively(TINY[kind]), pictures(2, 64, 32)
    with torch.no_grad():
        assert torch.allclose(network(x), torch.cat([network(x[:1]), network(x[1:])]), atol=1e-4)


@pytest.mark.parametrize(("kind", "stride"), [("resnet", 16), ("swin", 32), ("convnext", 32)])
def test_encoder_strides(kind, stride):
    low, high = TINY[kind].eval()(pictures(1, 64, 96))
    assert low.shape == (1, TINY[kind].channels[0], 16, 24)
    assert high.shape == (1, TINY[kind].channels[1], 64 // stride, 96 // stride)


def test_resnet_trades_stride_for_dilation_in_the_last_stage():
    last = ResNet((3, 4, 6, 3), 8).layer4
    assert [block.conv2.stride for block in last] == [(1, 1)] * 3
    assert [block.conv2.dilation for block in last] == [(1, 1), (2, 2), (2, 2)]


def test_published_weights_fit_the_encoder():
    encoder = ResNet((1, 1, 1, 1), 4)
    weights = {
        "layer4.0.conv2.weight": torch.ones(32, 32, 3, 3),
        "fc.weight": torch.ones(1000, 128),
    }
    assert DeepLab(encoder, 8, 4).load_encoder(weights) == 1
    assert float(encoder.layer4[0].conv2.weight.min()) == 1.0


def test_windows_come_back_where_they_were():
    x = torch.arange(2 * 14 * 21 * 3.0).view(2, 14, 21, 3)
    windows = to_windows(x)
    assert windows.shape == (2, 6, 49, 3)
    assert torch.equal(windows[0, 1].view(7, 7, 3), x[0, :7, 7:14])
    assert torch.equal(from_windows(windows, 2, 3), x)


def test_relative_index_is_the_same_for_the_same_offset():
    index = relative_index(7).view(7, 7, 7, 7)
    assert index.min() == 0
    assert index.max() == 13 * 13 - 1
    assert index[2, 3, 1, 1] == index[5, 6, 4, 4]
    assert index[2, 3, 1, 1] != index[1, 1, 2, 3]


def test_cyclic_shift_and_what_came_around():
    source, around = _turned(14, torch.device("cpu"))
    assert source.tolist() == [3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 0, 1, 2]
    assert around.tolist() == [False] * 11 + [True] * 3
    source, around = _turned(7, torch.device("cpu"))
    assert source.tolist() == list(range(7))
    assert not around.any()


def test_tokens_kept_apart_do_not_see_one_another():
    attention, x = WindowAttention(8, 2).eval(), torch.randn(1, 1, 49, 8)
    apart = torch.zeros(1, 49, 49, dtype=torch.bool)
    apart[0, :40, 40:] = True
    changed = x.clone()
    changed[0, 0, 40:] += 1
    with torch.no_grad():
        before, after = attention(x, apart), attention(changed, apart)
    assert torch.allclose(before[0, 0, :40], after[0, 0, :40], atol=1e-6)
    assert not torch.allclose(before[0, 0, 40:], after[0, 0, 40:], atol=1e-3)


def test_opposite_edges_of_the_picture_do_not_see_one_another():
    """The cyclic shift puts the last rows beside the first ones: only the mask keeps them apart."""
    block = Swin((2, 1, 1, 1), 12).layers[0].blocks[1].eval()
    x = torch.randn(1, 14, 14, 12)
    changed = x.clone()
    changed[:, 11:] += torch.randn(1, 3, 14, 12)
    with torch.no_grad():
        difference = (block(changed) - block(x)).abs().amax((0, 2, 3))
    assert difference[:3].max() == 0
    assert difference[11:].min() > 0


@pytest.mark.parametrize("kind", TINY)
def test_exported_equals_torch_at_every_size(kind, tmp_path, monkeypatch):
    monkeypatch.setattr(exporting, "WEIGHTS", tmp_path)
    network = lively(TINY[kind])
    examples = [pictures(1, *size) for size in (*SIZES[:3], (32, 256))]
    with torch.no_grad():
        assert network(examples[1]).std() > 0.05
    entry = manifest()["foreground_compact"]
    card = Card("1", "foreground", False, entry.input, "", "", {}, {}, {})
    assert export(network, kind, card, examples, dynamic_sides(), tolerance=1e-3) <= 1e-3
    assert kind in (tmp_path / "manifest.toml").read_text()


def test_training_by_name_gives_the_encoder_its_own_rate_and_resumes(tmp_path):
    learning = Learning("deeplab_convnext_t", 8, Config(minutes=1.0), encoder_rate=0.4)
    encoder, decoder = learning.course.optimizer.param_groups
    assert sum(p.numel() for p in encoder["params"]) == sum(
        p.numel() for p in learning.network.features.parameters()
    )
    image = torch.zeros(2, 3, 32, 32, dtype=torch.uint8)
    image[:, 0, 10:20] = 255
    learning.network.train()
    learning.step(image, image[:, 0])
    assert encoder["lr"] == pytest.approx(0.4 * decoder["lr"])
    learning.save(tmp_path / "last.pt", {})

    resumed = Learning("deeplab_convnext_t", 8, Config(minutes=1.0), encoder_rate=0.4)
    resumed.resume(tmp_path / "last.pt")
    assert torch.equal(resumed.network.head.weight, learning.network.head.weight)
    with pytest.raises(ValueError, match="deeplab_convnext_t --slim 8"):
        Learning("compact", 1, Config(minutes=1.0)).resume(tmp_path / "last.pt")
