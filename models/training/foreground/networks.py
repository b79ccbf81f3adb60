"""The foreground networks that can be trained, by name (thesis 2.7.1 and our own for
processors)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from models.training.foreground.network_compact import CompactNetwork
from models.training.foreground.network_convnext import ConvNeXt
from models.training.foreground.network_deeplab import DeepLab, Encoder
from models.training.foreground.network_dense import PLANS, DenseNetwork
from models.training.foreground.network_resnet import ResNet
from models.training.foreground.network_swin import Swin

ForegroundNetwork = CompactNetwork | DeepLab | DenseNetwork
"""Picture to logits; ``features`` is the encoder, ``load_encoder`` takes its published weights."""


def _deeplab(encoder: Callable[[int], Encoder]) -> Callable[[int], ForegroundNetwork]:
    return lambda slim: DeepLab(encoder(slim), 256 // slim, 48 // slim)


NETWORKS: Mapping[str, Callable[[int], ForegroundNetwork]] = {
    "compact": lambda slim: CompactNetwork(48 // slim),
    "dense": lambda slim: DenseNetwork(PLANS["dense"].divided(slim)),
    "dense_large": lambda slim: DenseNetwork(PLANS["dense_large"].divided(slim)),
    "deeplab_resnet50": _deeplab(lambda slim: ResNet((3, 4, 6, 3), 64 // slim)),
    "deeplab_resnet101": _deeplab(lambda slim: ResNet((3, 4, 23, 3), 64 // slim)),
    "deeplab_swin_t": _deeplab(lambda slim: Swin((2, 2, 6, 2), 96 // slim)),
    "deeplab_swin_s": _deeplab(lambda slim: Swin((2, 2, 18, 2), 96 // slim)),
    "deeplab_convnext_t": _deeplab(lambda slim: ConvNeXt((3, 3, 9, 3), 96 // slim)),
    "deeplab_convnext_s": _deeplab(lambda slim: ConvNeXt((3, 3, 27, 3), 96 // slim)),
}


def build(name: str, slim: int = 1) -> ForegroundNetwork:
    """A new network with random weights. ``slim`` divides its channels (1, 2, 4 or 8; of the
    compact one only those of the pyramid): for training and tests without a GPU. Raises
    ValueError."""
    if name not in NETWORKS:
        raise ValueError(f"unknown network {name!r}; there are {', '.join(NETWORKS)}")
    if slim not in (1, 2, 4, 8):
        raise ValueError(f"slim must be 1, 2, 4 or 8, not {slim}")
    return NETWORKS[name](slim)


def stored(params: Mapping[str, Any]) -> tuple[str, int]:
    """Name and ``slim`` from a checkpoint's ``params``; the first checkpoints, all compact, do not
    say."""
    return params.get("network", "compact"), params.get("slim", 1)
