"""Which network a name stands for, and the loaded ones: those that ship, and those of the users."""

from __future__ import annotations

import re
from collections import OrderedDict
from dataclasses import dataclass, field

from dlo_client.contracts.networks import NetworkCard

from models.weights import inference
from models.weights.inference import Network, NetworkSpec, Runtime, default_name, manifest
from workers.networks.package import PackageError
from workers.networks.store import NetworkStore, NetworkUnknownError

TASK = "foreground"
_MOST_LOADED = 4
"""Of users' networks; the one that was used longest ago goes first."""
_NAME = re.compile(r"[a-z0-9][a-z0-9_.-]{0,63}(@[1-9]\d{0,5})?")


class NoSuchNetworkError(ValueError):
    """``field`` of the request names a network that is not there, or not whole."""

    def __init__(self, field: str, message: str) -> None:
        super().__init__(message)
        self.field = field


@dataclass
class Networks:
    """``store`` holds the users' networks; None where there are none."""

    runtime: Runtime
    store: NetworkStore | None = None
    default_model: str = ""
    loaded: dict[str, Network] = field(default_factory=dict)
    _stored: OrderedDict[str, Network] = field(default_factory=OrderedDict)

    def shipped(self, name: str) -> Network:
        """Loaded once, then kept; raises models.weights.inference.UnknownNetworkError."""
        if name not in self.loaded:
            self.loaded[name] = inference.load(name, self.runtime)
        return self.loaded[name]

    def foreground(
        self, model: str | None, default: str | None = None, *, eight_bit: bool = False
    ) -> Network:
        """The network that ``model`` names now, so a version that was chosen a moment ago is taken;
        without one the ``default``, the service's, the shipped one. ``eight_bit``: its 8-bit form,
        where it has one.

        Raises NoSuchNetworkError naming ``model``, or ``default_model``.
        """
        for field_name, name in (
            ("model", model),
            ("default_model", default),
            ("default_model", self.default_model),
        ):
            if name:
                return self._named(field_name, name, eight_bit)
        return self._named("model", default_name(TASK), eight_bit)

    def _named(self, field_name: str, name: str, eight_bit: bool) -> Network:
        spec = manifest().get(name)
        if spec is not None and spec.task == TASK:
            return self.shipped(inference.eight_bit(name) if eight_bit else name)
        if spec is None and self.store is not None and _NAME.fullmatch(name):
            try:
                return self._from_store(self.store, *self.store.find(name))
            except NetworkUnknownError:
                pass  # said below, with what there is
            except PackageError as error:
                raise NoSuchNetworkError(field_name, f"{name!r} was damaged: {error}") from error
        known = ", ".join(
            [*(s.name for s in manifest().values() if s.task == TASK), *self._stored_names()]
        )
        raise NoSuchNetworkError(
            field_name, f"there is no foreground network {name!r}; there are: {known}"
        )

    def _stored_names(self) -> list[str]:
        return self.store.names() if self.store else []

    def _from_store(self, store: NetworkStore, name: str, version: int) -> Network:
        card = store.card(name, version)
        key = f"{name}@{version} {card.sha256}"
        if key not in self._stored:
            data = store.onnx(name, version)
            self._stored[key] = inference.opened(
                spec_of(card, name, str(version), len(data)), data, self.runtime
            )
            while len(self._stored) > _MOST_LOADED:
                self._stored.popitem(last=False)
        self._stored.move_to_end(key)
        return self._stored[key]


def spec_of(card: NetworkCard, name: str, version: str, size: int) -> NetworkSpec:
    """What the manifest says of a shipped network, of one of a user's; ``size`` of its ONNX file in
    bytes."""
    return NetworkSpec(
        name=name,
        version=version,
        task=card.task,
        default=False,
        file="",
        sha256=card.sha256,
        bytes=size,
        parameters=card.parameters,
        input="",
        license=card.license,
        origin=card.origin,
        preprocess=card.preprocess.model_dump(),
        training={"network": card.architecture},
        metrics=card.metrics,
    )
