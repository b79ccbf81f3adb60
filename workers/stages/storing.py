"""A network into the store of its owner: what ``import_network`` and ``adapt`` share."""

from __future__ import annotations

from dlo_client.contracts.networks import NetworkCard

from models.weights.inference import manifest
from workers.networks.store import NetworkStore, NetworkUnknownError, StoreFullError
from workers.stages.outcome import InvalidInput, Tools

INVALID = "invalid_network"


def store_as(card: NetworkCard, onnx: bytes, name: str, field: str, tools: Tools) -> int:
    """Store it as a further version of ``name``; the version. Raises InvalidInput naming
    ``field``."""
    assert tools.store is not None
    check_name(name, field, tools.store, tools.owner)
    try:
        return tools.store.add(card, onnx, name, tools.owner)
    except StoreFullError as error:
        raise InvalidInput(field, str(error), INVALID) from error


def check_name(name: str, field: str, store: NetworkStore, owner: str) -> None:
    """Raises InvalidInput unless ``owner`` may store a network of this name."""
    if name in manifest():
        raise InvalidInput(
            field, f"{name!r} is the name of a network that ships with the service", "name_taken"
        )
    try:
        holder = store.owner(name)
    except NetworkUnknownError:
        return
    if holder != owner:
        raise InvalidInput(field, f"{name!r} is a network of another API key", "name_taken")
