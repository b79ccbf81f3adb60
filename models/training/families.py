"""The table of networks that this repository trains: ``python -m models.training NAME``.

The foreground networks have a command of their own (``models.training.foreground.campaign``):
scenes are rendered while they learn. What is fitted without a network is made by
``models.training.instances.section_matching_links`` and ``models.training.instances.confidence``.
"""

from __future__ import annotations

from models.training.corrector import corrector
from models.training.disentangling import moves
from models.training.dynamics import train as dynamics
from models.training.fit import AnyFamily
from models.training.instances import ariadne_plus_networks, fastdlo_similarity, rt_dlo_orientation
from models.training.topology import classifiers
from models.training.topology import train as topology

FAMILIES: dict[str, AnyFamily] = {
    family.name: family
    for family in (
        rt_dlo_orientation.FAMILY,
        fastdlo_similarity.FAMILY,
        ariadne_plus_networks.TRIPLET_FAMILY,
        ariadne_plus_networks.CROSS_FAMILY,
        corrector.FAMILY,
        dynamics.FAMILY,
        topology.FAMILY,
        *classifiers.FAMILIES,
        moves.FAMILY,
    )
}
