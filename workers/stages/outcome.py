"""What a stage is given and what it gives back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from dlo_client.contracts import Contract, NetworkInfo

from models.weights.inference import Network, Runtime
from workers.blobs import Blobs
from workers.networks.store import NetworkStore
from workers.stages.networks import Networks
from workers.unsure import UnsureStore


def _nobody(fraction: float) -> None:
    """Progress that nobody watches."""


@dataclass
class Tools:
    """What the warm child holds ready for every job."""

    blobs: Blobs
    max_image_pixels: int
    runtime: Runtime
    networks: list[NetworkInfo] = field(default_factory=list)
    """What a request may name, or the service uses by itself."""
    progress: Callable[[float], None] = _nobody
    """To be called with the share that is done, 0 to 1; set anew for each job."""
    store: NetworkStore | None = None
    """Where networks that users adapt or bring are kept."""
    default_model: str = ""
    owner: str = ""
    """Of the job, set anew for each: the name of the API key that it came with."""
    max_network_bytes: int = 2**27
    training_dir: Path | None = None
    unsure: UnsureStore | None = None
    training_options: Sequence[str] = ()
    """More of the command line of an adaptation, for tests."""

    def __post_init__(self) -> None:
        self.weights = Networks(self.runtime, self.store, self.default_model)

    def network(self, name: str) -> Network:
        """One that ships; raises models.weights.inference.UnknownNetworkError."""
        return self.weights.shipped(name)


@dataclass(frozen=True)
class Outcome:
    """A job's result, its files as name → (media type, bytes), and what its steps took."""

    result: Contract
    files: dict[str, tuple[str, bytes]] = field(default_factory=dict)
    timings_ms: dict[str, float] = field(default_factory=dict)


class InvalidInput(Exception):
    """The request's fault: ``field`` as in ``views.1.image``; ``code`` is ``invalid_*``."""

    def __init__(self, field: str, message: str, code: str = "invalid_image") -> None:
        super().__init__(f"{field}: {message}")
        self.field = field
        self.message = message
        self.code = code
