"""A shipped network back to one that can be trained further, when its checkpoint is gone, and into
its file again."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn


def unfold(file: Path, network: nn.Module, pictures: Iterable[Tensor] | None = None) -> int:
    """Give ``network`` the weights of its own exported ``file``; returns how many convolutions were
    taken.

    The exporter folds batch normalizations into the convolutions before them. Here the folded
    weights go back into the convolution, and the normalization gets the statistics that
    ``pictures`` (normalized, (B, 3, H, W)) produce and the scale and shift that undo them: the same
    function, in training mode too. Without ``pictures`` the statistics are 0 and 1: the same
    function in evaluation mode alone.

    Raises ValueError when the file is of another network, or of a Swin, whose tables of relative
    positions the exporter turns into what they stand for.
    """
    graph = onnx.load(file).graph
    stored, biases = _stored(graph), _biases(graph)
    folded = {
        name: norm for name, norm in _normalized(network).items() if f"{name}.weight" in biases
    }
    passed = set(folded.values())
    for prefix, module in network.named_modules():
        if module not in passed:
            _take(module, prefix, stored)
    for name, norm in folded.items():
        _pass_through(norm, stored[biases[f"{name}.weight"]])
    if pictures is not None:
        _calibrate(network, folded, pictures)
    return len(_convolutions(network))


def _stored(graph: onnx.GraphProto) -> dict[str, Tensor]:
    """The file's numbers by name. The weights of a linear layer are kept turned and without their
    name: it follows from the bias that is added next."""
    values = {i.name: torch.from_numpy(numpy_helper.to_array(i).copy()) for i in graph.initializer}
    added = {
        name: node.input for node in graph.node if node.op_type == "Add" for name in node.input
    }
    for node in graph.node:
        if node.op_type == "MatMul" and node.input[1] in values:
            bias = next((n for n in added.get(node.output[0], ()) if n in values), "")
            values[f"{bias.removesuffix('bias')}weight"] = values[node.input[1]].T
    return values


def _biases(graph: onnx.GraphProto) -> dict[str, str]:
    """Names of the biases of convolutions, by those of their weights."""
    return {
        node.input[1]: node.input[2]
        for node in graph.node
        if node.op_type == "Conv" and len(node.input) > 2
    }


@torch.no_grad()
def _take(module: nn.Module, prefix: str, stored: dict[str, Tensor]) -> None:
    """What the module itself holds of parameters, and of statistics that are in the file."""
    for name, own in module.named_parameters(prefix, recurse=False):
        found = stored.get(name)
        if found is None or found.shape != own.shape:
            raise ValueError(f"the file has no {name} of shape {tuple(own.shape)}")
        own.copy_(found)
    for name, statistic in module.named_buffers(prefix, recurse=False):
        if name in stored:
            statistic.copy_(stored[name])


def refold(file: Path, network: nn.Module, share: float = 1.0) -> bytes:
    """The exported ``file`` of the same network with the weights of ``network``, each normalization
    folded into the convolution before it; ``share`` of them, the rest stays as it is in the file.

    Raises ValueError when the file is of another network.
    """
    model = onnx.load(file)
    pairs, convolutions = _normalized(network), _convolutions(network)
    places = {i.name: i for i in model.graph.initializer}
    for node in model.graph.node:
        if node.op_type != "Conv":
            continue
        name = node.input[1].removesuffix(".weight")
        if name not in convolutions:
            raise ValueError(f"the network has no {name}")
        for place, new in zip(
            node.input[1:], _folded(convolutions[name], pairs.get(name)), strict=False
        ):
            old = numpy_helper.to_array(places[place])
            if old.shape != tuple(new.shape):
                raise ValueError(
                    f"{name} is {tuple(new.shape)} in the network, {old.shape} in the file"
                )
            mixed = old + share * (new.detach().numpy() - old)
            places[place].CopyFrom(numpy_helper.from_array(mixed.astype(old.dtype), place))
    written: bytes = model.SerializeToString()
    return written


def _folded(conv: nn.Conv2d, norm: nn.BatchNorm2d | None) -> tuple[Tensor, Tensor]:
    """Weight and bias that do what both do one after the other."""
    bias = conv.bias if conv.bias is not None else torch.zeros(conv.out_channels)
    if norm is None:
        return conv.weight, bias
    assert norm.running_mean is not None
    assert norm.running_var is not None
    scale = norm.weight / (norm.running_var + norm.eps).sqrt()
    return conv.weight * scale[:, None, None, None], norm.bias + (bias - norm.running_mean) * scale


def _convolutions(network: nn.Module) -> dict[str, nn.Conv2d]:
    return {name: m for name, m in network.named_modules() if isinstance(m, nn.Conv2d)}


def _normalized(network: nn.Module) -> dict[str, nn.BatchNorm2d]:
    """The normalization that follows each convolution, in its sequence or as ``bn1`` follows
    ``conv1``, by the convolution's name."""
    pairs = {}
    for prefix, module in network.named_modules():
        children = dict(module.named_children())
        after = dict(pairwise(children)) if isinstance(module, nn.Sequential) else {}
        for name, first in children.items():
            second = children.get(after.get(name, name.replace("conv", "bn")))
            if isinstance(first, nn.Conv2d) and isinstance(second, nn.BatchNorm2d):
                pairs[f"{prefix}.{name}" if prefix else name] = second
    return pairs


@torch.no_grad()
def _pass_through(norm: nn.BatchNorm2d, bias: Tensor) -> None:
    assert norm.running_mean is not None
    assert norm.running_var is not None
    norm.running_mean.zero_()
    norm.running_var.fill_(1.0)
    norm.weight.fill_((1.0 + norm.eps) ** 0.5)
    norm.bias.copy_(bias)


@torch.no_grad()
def _calibrate(
    network: nn.Module, pairs: dict[str, nn.BatchNorm2d], pictures: Iterable[Tensor]
) -> None:
    sums: dict[str, list[Tensor]] = {name: [] for name in pairs}
    convolutions = _convolutions(network)

    def watch(name: str) -> None:
        convolutions[name].register_forward_hook(
            lambda _m, _i, out: sums[name].append(
                torch.stack([out.mean((0, 2, 3)), out.square().mean((0, 2, 3))])
            )
        )

    for name in pairs:
        watch(name)
    network.eval()
    for picture in pictures:
        network(picture)
    for name, norm in pairs.items():
        convolutions[name]._forward_hooks.clear()
        mean, square = torch.stack(sums[name]).mean(0)
        variance = (square - mean.square()).clamp(min=1e-8)
        assert norm.running_mean is not None
        assert norm.running_var is not None
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)
        norm.weight.copy_((variance + norm.eps).sqrt())
        norm.bias.add_(mean)
