"""Which columns each classifier weighs, by its task."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from models.topology.bridges import BridgeEvidence
from models.topology.classifiers import Classifiers
from models.topology.sites import SiteEvidence
from models.topology.stubs import StubEvidence
from models.weights.inference import Network

FEATURES: Mapping[str, tuple[str, ...]] = {
    "junctions": SiteEvidence._fields,
    "bridges": BridgeEvidence._fields,
    "stubs": StubEvidence._fields,
}
"""In the order of :class:`Classifiers`."""


def classifiers_of(network_of: Callable[[str], Network]) -> Classifiers:
    """The classifiers, their networks taken by task. Raises FeaturesDifferError where one weighs
    other columns."""
    return Classifiers(
        *(network_of(task).weighing(features) for task, features in FEATURES.items())
    )
