"""A foreground network that somebody brings: is it one, and does it work? To be asked where it may
crash."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from models.weights.inference import Network, NetworkSpec, Runtime, opened

_MOST_LOGIT = 1e4
_SIZES = ((1, 1), (2, 3))
"""Of the pictures that it is tried on, in multiples of what it needs."""


class UnfitNetworkError(ValueError):
    """The file is no foreground network that could be used; the message states why."""


def fit_foreground(spec: NetworkSpec, data: bytes, runtime: Runtime | None = None) -> Network:
    """The network of the ONNX file ``data``, tried on pictures of two sizes.

    Raises UnfitNetworkError.
    """
    if (
        b"location" in data
    ):  # the key of weights in other files, which would be read from this machine's disk
        raise UnfitNetworkError("it refers to weights in other files; they have to be inside")
    try:
        network = opened(spec, data, runtime)
    except Exception as error:  # what the runtime raises has no common type
        raise UnfitNetworkError(f"it cannot be loaded: {_first_line(error)}") from error
    _check_doors(network)
    multiple = int(spec.preprocess["multiple"])
    rng = np.random.default_rng(0)
    for rows, columns in _SIZES:
        size = (max(rows * multiple, 32), max(columns * multiple, 32))
        size = tuple(-(-side // multiple) * multiple for side in size)  # type: ignore[assignment]
        _try(network, rng.normal(size=(1, 3, *size)).astype(np.float32))
    return network


def _check_doors(network: Network) -> None:
    inputs, outputs = network.doors()
    if len(inputs) != 1 or len(outputs) != 1:
        raise UnfitNetworkError(
            f"it has {len(inputs)} inputs and {len(outputs)} outputs, one of each is needed"
        )
    (kind, shape), wanted = inputs[0], "(1, 3, H, W) float32"
    if kind != "tensor(float)" or not _allows(shape, (1, 3)):
        raise UnfitNetworkError(f"its input is {shape} of {kind}, {wanted} is needed")
    if any(isinstance(side, int) for side in shape[2:]):
        raise UnfitNetworkError(f"its input is {shape}: height and width have to be free")


def _allows(shape: Sequence[object], first: tuple[int, int]) -> bool:
    """A side that is free has a name in place of a number."""
    return len(shape) == 4 and all(
        not isinstance(s, int) or s == wanted for s, wanted in zip(shape, first, strict=False)
    )


def _try(network: Network, picture: np.ndarray) -> None:
    try:
        (logits,) = network.run(picture)
    except Exception as error:
        raise UnfitNetworkError(
            f"it fails on a picture of {picture.shape[2:]}: {_first_line(error)}"
        ) from error
    expected = (1, 1, *picture.shape[2:])
    if logits.shape != expected:
        raise UnfitNetworkError(
            f"it answers {logits.shape} to a picture of {picture.shape}, {expected} is needed"
        )
    if not np.isfinite(logits).all() or np.abs(logits).max() > _MOST_LOGIT:
        raise UnfitNetworkError("its answers are not finite, or far from any log odds")


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0][:200] if str(error) else type(error).__name__
