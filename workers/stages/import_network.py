"""``import_network``: an uploaded file to a network that requests may name."""

from __future__ import annotations

from dlo_client.contracts.networks import ImportNetworkRequest, ImportNetworkResult

from models.weights.foreign import UnfitNetworkError, fit_foreground
from workers.blobs import BlobMissing
from workers.networks.package import PackageError, unpack
from workers.stages.networks import spec_of
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.storing import INVALID, store_as


def run(request: ImportNetworkRequest, tools: Tools) -> Outcome:
    """Raises InvalidInput for a file that is none, a network that is unfit, and a name that another
    holds."""
    try:
        data = tools.blobs.get(request.file.id)
    except BlobMissing as error:
        raise InvalidInput(
            "file", "its bytes have expired: upload it again", "unknown_file"
        ) from error
    try:
        card, onnx = unpack(data, tools.max_network_bytes)
        fit_foreground(spec_of(card, card.name, "0", len(onnx)), onnx, tools.runtime)
    except (PackageError, UnfitNetworkError) as error:
        raise InvalidInput("file", str(error), INVALID) from error
    name = request.name or card.name
    store_as(card, onnx, name, "name" if request.name else "file", tools)
    assert tools.store is not None
    return Outcome(ImportNetworkResult(network=tools.store.info(name)))
