"""The classifiers of evidence: crossing, lens or branch-points; gap or end; branch or stub.

    python -m models.training topology_stubs && python -m models.training topology_bridges &&
    python -m models.training topology_junctions

In this order, after ``topology``: what the networks before make of nodes, links, stubs and gaps is
part of the evidence. The scenes are others than ``topology`` was trained on; they are kept, so the
first command takes a quarter of an hour on one core and the others minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from models.geometry.arrays import Float32Array, IntArray
from models.topology.classifiers import Classifier, Classifiers
from models.topology.evidence import FEATURES
from models.topology.sites import Reading
from models.training.export import Exported
from models.training.fit import Family, Source
from models.training.state import Config, kept
from models.training.topology.evidence import (
    Scene,
    Table,
    bridge_table,
    crossing_table,
    scenes,
    stub_table,
)
from models.training.topology.network_topology import JunctionNetwork
from models.weights.inference import Runtime, load

BRIDGES, STUBS, CROSSINGS = "topology_bridges", "topology_stubs", "topology_junctions"
_FIRST, _HELD_OUT = 5 * 10**5, 10**6


@dataclass(frozen=True)
class ClassifierConfig(Config):
    """``jitter``: noise on the evidence, in its standard deviations: there are few places to learn
    from."""

    seed: int = 11
    epochs: int = 40
    batch: int = 128
    rate: float = 3e-3
    weight_decay: float = 0.05
    scenes: int = 5200
    held_out: int = 280
    jitter: float = 0.3
    hidden: int = 24


class Probabilities(nn.Module):
    """What is exported: the network followed by the softmax that its loss implies."""

    def __init__(self, network: nn.Module) -> None:
        super().__init__()
        self.network = network

    def forward(self, evidence: Tensor) -> Tensor:
        """``(n, features)`` evidence to ``(n, readings)`` probabilities; of two readings, ``(n,)``
        of the second."""
        found = torch.softmax(self.network(evidence), dim=1)
        return found[:, 1] if found.shape[1] == 2 else found


def loss_of(
    network: nn.Module,
    table: Table,
    rows: IntArray,
    rng: np.random.Generator,
    config: ClassifierConfig,
) -> Tensor:
    assert isinstance(network, JunctionNetwork)
    inputs = torch.from_numpy(table.rows[rows])
    noise = torch.from_numpy(rng.standard_normal(inputs.shape, np.float32))
    noisy = inputs + config.jitter * network.scale * noise
    return nn.functional.cross_entropy(network(noisy), torch.from_numpy(table.truths[rows]))


def figures(network: nn.Module, table: Table, readings: Sequence[str]) -> dict[str, float]:
    """Share of places that are read right, in all and of each reading; ``gain``: by how much more
    than by always giving the most frequent one."""
    with torch.inference_mode():
        right = network(torch.from_numpy(table.rows)).numpy().argmax(axis=1) == table.truths
    shares = {f"{reading}_right": right[table.truths == k] for k, reading in enumerate(readings)}
    found = {
        name: round(float(values.mean()), 4)
        for name, values in {"accuracy": right, **shares}.items()
        if len(values)
    }
    return {**found, "gain": round(found["accuracy"] - _most_frequent(table), 4)}


def without(table: Table, config: ClassifierConfig) -> dict[str, Any]:
    return {"rule": "always the most frequent reading", "accuracy": _most_frequent(table)}


def _most_frequent(table: Table) -> float:
    """Share of the most frequent reading."""
    return round(float(np.bincount(table.truths).max() / len(table)), 4)


def classifier(
    name: str,
    task: str,
    what: str,
    readings: Sequence[str],
    features: Sequence[str],
    config: type[ClassifierConfig],
    samples: Callable[[ClassifierConfig, Source], tuple[Table, Table]],
) -> Family[ClassifierConfig, Table]:
    """A row of the table of networks for one kind of evidence: ``what`` its rows are, the
    ``readings`` that the network tells apart, the names of its ``features``."""

    def build(config: ClassifierConfig, table: Table) -> nn.Module:
        network = JunctionNetwork(table.rows.shape[1], len(readings), config.hidden)
        network.mean = torch.from_numpy(table.rows.mean(axis=0))
        network.scale = torch.from_numpy(table.rows.std(axis=0) + 1e-3)
        return network

    def measure(network: nn.Module, table: Table, config: ClassifierConfig) -> dict[str, float]:
        return figures(network, table, readings)

    def exports(network: nn.Module, table: Table, config: ClassifierConfig) -> list[Exported]:
        count = table.rows.shape[1]
        rng = torch.Generator().manual_seed(config.seed)
        places = np.bincount(table.truths, minlength=len(readings)).tolist()
        return [
            Exported(
                name,
                Probabilities(network),
                task,
                f"(n, {count}) float32: {what}",
                "trained from scratch on masks of random harnesses that training draws itself",
                {},
                [(torch.rand(n, count, generator=rng),) for n in (2, 0, 1, 40)],
                [{0: torch.export.Dim("n")}],
                1e-4,
                ("evidence",),
                ("probability",),
                features=features,
                facts={"places": dict(zip(readings, places, strict=True))},
            )
        ]

    return Family(
        name, config, samples, build, loss_of, measure, without, exports, least={"gain": 0.0}
    )


def _both(
    make: Callable[[list[Scene]], Table],
) -> Callable[[ClassifierConfig, Source], tuple[Table, Table]]:
    """The tables of training and held-out scenes; the scenes are drawn once and kept."""

    def samples(config: ClassifierConfig, source: Source) -> tuple[Table, Table]:
        seen = _scenes(source.folder, config.seed, _FIRST, config.scenes)
        return make(seen), make(_scenes(source.folder, config.seed, _HELD_OUT, config.held_out))

    return samples


def _scenes(folder: Path, seed: int, first: int, count: int) -> list[Scene]:
    file = folder / f"places-{seed}-{first}-{count}.pickle"
    return kept(file, lambda: scenes(seed, first, count, load("topology", Runtime(threads=1))))


def _before(name: str) -> Classifier:
    """A classifier that was trained before."""
    return load(name, Runtime(threads=1))


def _unused(rows: Float32Array) -> Float32Array:
    raise AssertionError("a classifier is used before it is trained")


FAMILIES = (
    classifier(
        STUBS,
        "stubs",
        "evidence of short strands",
        ("stub", "branch"),
        FEATURES["stubs"],
        ClassifierConfig,
        _both(stub_table),
    ),
    classifier(
        BRIDGES,
        "bridges",
        "evidence of places where a strand may go on over a gap",
        ("end", "gap"),
        FEATURES["bridges"],
        ClassifierConfig,
        _both(lambda seen: bridge_table(seen, Classifiers(_unused, _unused, _before(STUBS)))),
    ),
    classifier(
        CROSSINGS,
        "junctions",
        "evidence at places where strands meet",
        tuple(r.name.lower() for r in Reading),
        FEATURES["junctions"],
        ClassifierConfig,
        _both(
            lambda seen: crossing_table(
                seen, Classifiers(_unused, _before(BRIDGES), _before(STUBS))
            )
        ),
    ),
)
