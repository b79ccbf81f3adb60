"""The instance methods: a row each, one signature for all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from models.geometry.arrays import BoolArray, ByteArray
from models.instances import section_matching
from models.instances.published import ariadne_plus, fastdlo, rt_dlo
from models.instances.scene import Scene
from models.weights.inference import Network

Extract = Callable[[BoolArray, ByteArray | None], Scene]


@dataclass(frozen=True)
class Method:
    """``extract(mask, image, params, networks)``; ``tasks`` of the networks, in the order that it
    takes them."""

    extract: Callable[..., Scene]
    params: type
    tasks: tuple[str, ...] = ()


METHODS = {
    "section_matching": Method(section_matching.extract, section_matching.SectionMatchingParams),
    "rt_dlo": Method(rt_dlo.extract, rt_dlo.RtDloParams, ("orientation",)),
    "fastdlo": Method(fastdlo.extract, fastdlo.FastDloParams, ("similarity",)),
    "ariadne_plus": Method(
        ariadne_plus.extract, ariadne_plus.AriadnePlusParams, ("triplet", "above")
    ),
}


def method(
    name: str, network: Callable[[str], Network], **values: Any
) -> tuple[Extract, list[Network]]:
    """Mask and picture to scene, and the networks that take part.

    ``network``: the network of a task; ``values``: parameters where they are not the defaults.
    """
    row = METHODS[name]
    params, networks = row.params(**values), [network(task) for task in row.tasks]
    return lambda mask, image: row.extract(mask, image, params, networks), networks
