"""The rendered crossings that the networks of the published instance methods learn from."""

from __future__ import annotations

from dataclasses import dataclass

from models.synthesis.crossings import RenderedCrossing, crossings_kept
from models.training.fit import Source
from models.training.state import Config

Crossings = list[RenderedCrossing]


@dataclass(frozen=True)
class CrossingConfig(Config):
    """``crossings`` are rendered once, the first ``held_out`` of them are kept for measuring."""

    seed: int = 11
    crossings: int = 7000
    held_out: int = 1000

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.held_out < self.crossings:
            raise ValueError(
                f"held_out is {self.held_out} of {self.crossings} crossings: some must be left to learn from"
            )


def crossing_samples(config: CrossingConfig, source: Source) -> tuple[Crossings, Crossings]:
    scenes = crossings_kept(source.folder, config.crossings, config.seed, source.textures)
    return scenes[config.held_out :], scenes[: config.held_out]
