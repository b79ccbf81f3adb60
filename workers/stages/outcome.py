"""What a stage is given and what it gives back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from dlo_client.contracts import Contract, NetworkInfo

from models.weights import inference
from models.weights.inference import Network, Runtime
from workers.blobs import Blobs


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
    loaded: dict[str, Network] = field(default_factory=dict)

    def network(self, name: str) -> Network:
        """Loaded once, then kept; raises models.weights.inference.UnknownNetworkError."""
        if name not in self.loaded:
            self.loaded[name] = inference.load(name, self.runtime)
        return self.loaded[name]


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
