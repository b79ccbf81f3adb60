"""The networks of the package: loaded on first use, then kept."""

from __future__ import annotations

from functools import cache

from models.library.arguments import ArgumentError
from models.weights import inference
from models.weights.inference import Network, NetworkSpec, Runtime

_runtime = Runtime()


def configure(providers: tuple[str, ...] = ("CPUExecutionProvider",), threads: int = 0) -> None:
    """Where networks run from now on: ONNX Runtime's execution providers in order of preference,
    and threads a network (0: one a core). Those already loaded are loaded anew."""
    global _runtime
    _runtime = Runtime(providers=providers, threads=threads)
    _loaded.cache_clear()


def networks() -> dict[str, NetworkSpec]:
    """Every network of the package by name: task, version, origin, license, metrics."""
    return dict(inference.manifest())


def named(name: str, task: str, argument: str) -> Network:
    """A network of this task; raises ArgumentError for another name."""
    known = [spec.name for spec in inference.manifest().values() if spec.task == task]
    if name not in known:
        raise ArgumentError(
            argument, f"is {name!r}; the networks for {task} are {', '.join(known)}"
        )
    return _loaded(name)


def default(task: str) -> Network:
    """The network for ``task`` when none is named."""
    return _loaded(inference.default_name(task))


def foreground(name: str | None, eight_bit: bool) -> Network:
    """The foreground network of this name, or the default one; its 8-bit form where that is asked
    for and there is one. Raises ArgumentError."""
    chosen = default("foreground") if name is None else named(name, "foreground", "model")
    return _loaded(inference.eight_bit(chosen.spec.name)) if eight_bit else chosen


@cache
def _loaded(name: str) -> Network:
    return inference.load(name, _runtime)
