"""The instance method that a request names, with its parameters and the networks it needs."""

from __future__ import annotations

from dlo_client.contracts import InstanceMethod
from dlo_client.contracts.methods import MethodParams

from models.instances.methods import Extract, method
from models.weights.inference import Network, default_name
from workers.stages.outcome import Tools


def extract_with(
    name: InstanceMethod, params: MethodParams | None, tools: Tools
) -> tuple[Extract, list[Network]]:
    """Mask and picture to scene, and the networks that take part. Networks are loaded when first
    needed."""
    values = {} if params is None else params.model_dump(exclude={"method"})
    return method(
        name if params is None else params.method,
        lambda task: tools.network(default_name(task)),
        **values,
    )
