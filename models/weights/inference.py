"""A network's name to a callable over ONNX Runtime. A file that the manifest does not know is
refused."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from models.weights.providers import CPU, session

WEIGHTS = Path(__file__).parent


class UnknownNetworkError(ValueError):
    """The manifest has no network of this name (or task)."""


class CorruptWeightsError(RuntimeError):
    """The file on disk is not the one that the manifest names."""


class FeaturesDifferError(RuntimeError):
    """The network was trained on other columns of evidence than this version measures."""


@dataclass(frozen=True)
class Card:
    """What the manifest holds of a network besides what can be read off its file. ``preprocess``:
    what a caller needs to feed it: sizes, normalization, threshold; ``training`` and ``metrics``:
    where it comes from and how good it is; ``features``: names of the columns of a row of evidence;
    ``without``: what the ``metrics`` would be without the network, by the ``rule`` that would stand
    in for it."""

    version: str
    task: str
    default: bool
    input: str
    license: str
    origin: str
    preprocess: Mapping[str, Any]
    training: Mapping[str, Any]
    metrics: Mapping[str, float]
    features: Sequence[str] = ()
    without: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class NetworkSpec(Card):
    """One entry of ``weights/manifest.toml``."""

    name: str
    file: str
    sha256: str
    bytes: int
    parameters: int


@dataclass(frozen=True)
class Runtime:
    """Where networks run: ONNX Runtime execution providers in order of preference, and threads a
    network (0: one a core). ``spinning`` off keeps idle threads from stealing time from other
    workers."""

    providers: Sequence[str] = (CPU,)
    threads: int = 0
    spinning: bool = False


class Network:
    """A loaded network: arrays in, arrays out."""

    def __init__(self, spec: NetworkSpec, session: onnxruntime.InferenceSession) -> None:
        self.spec = spec
        self._session = session
        self._inputs = [i.name for i in session.get_inputs()]
        self.provider: str = session.get_providers()[0]
        """The execution provider of ONNX Runtime that it runs on."""

    def __call__(self, inputs: NDArray[np.float32]) -> NDArray[np.float32]:
        """The output of a network with one input and one output; shapes as in ``spec.input``."""
        (output,) = self.run(inputs)
        return output

    def weighing(self, features: Sequence[str]) -> Network:
        """This network, if these are the columns that it was trained on, in this order. Raises
        FeaturesDifferError."""
        if tuple(self.spec.features) != tuple(features):
            lacking = [f for f in features if f not in self.spec.features]
            unknown = [f for f in self.spec.features if f not in features]
            raise FeaturesDifferError(
                f"{self.spec.name} weighs other evidence than is measured: it lacks {lacking or 'nothing'}, expects "
                f"{unknown or 'nothing'} besides{'' if lacking or unknown else ', but in another order'}; train it anew"
            )
        return self

    def doors(self) -> tuple[list[tuple[str, list[Any]]], list[tuple[str, list[Any]]]]:
        """Type and shape of each input and of each output; a free side has a name, or nothing, for
        a number."""
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        return [(i.type, i.shape) for i in inputs], [(o.type, o.shape) for o in outputs]

    def run(self, *inputs: NDArray) -> tuple[NDArray, ...]:
        """All outputs, in the network's order, of inputs in its order."""
        feed = dict(zip(self._inputs, inputs, strict=True))
        return tuple(np.asarray(output) for output in self._session.run(None, feed))


@cache
def manifest() -> Mapping[str, NetworkSpec]:
    """Every network that ships with this version, by name."""
    entries = tomllib.loads((WEIGHTS / "manifest.toml").read_text())
    return {name: NetworkSpec(name=name, **entry) for name, entry in entries.items()}


def spec_of(name: str) -> NetworkSpec:
    """The manifest's entry of a network. Raises UnknownNetworkError."""
    if name not in manifest():
        raise UnknownNetworkError(
            f"unknown network {name!r}; there are {', '.join(sorted(manifest()))}"
        )
    return manifest()[name]


def default_name(task: str) -> str:
    """The network to use for ``task`` when nobody asks for another."""
    for name, spec in manifest().items():
        if spec.task == task and spec.default:
            return name
    raise UnknownNetworkError(f"no default network for {task!r}")


def eight_bit(name: str) -> str:
    """Name of the 8-bit form of a network; its own where it has none."""
    small = f"{name}_int8"
    return small if small in manifest() else name


def load(name: str, runtime: Runtime | None = None) -> Network:
    """Check the file of a shipped network against its SHA-256 and open it.

    Raises UnknownNetworkError, CorruptWeightsError.
    """
    spec = spec_of(name)
    data = (WEIGHTS / spec.file).read_bytes()
    if hashlib.sha256(data).hexdigest() != spec.sha256:
        raise CorruptWeightsError(f"{spec.file} is not the file that the manifest names")
    return opened(spec, data, runtime)


def opened(spec: NetworkSpec, data: bytes, runtime: Runtime | None = None) -> Network:
    """The network of ``data``, the bytes of an ONNX file; raises
    models.weights.providers.ProviderMissingError."""
    runtime = runtime or Runtime()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = runtime.threads
    options.add_session_config_entry(
        "session.intra_op.allow_spinning", "1" if runtime.spinning else "0"
    )
    return Network(spec, session(data, options, runtime.providers))
