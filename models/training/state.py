"""The state of a training on disk, so that a second start goes on from it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch


def save(path: Path, config: Mapping[str, Any], parts: Mapping[str, Any], epoch: int) -> None:
    """Write the states of ``parts`` (network, optimizer …); the file is never half written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    states = {name: part.state_dict() for name, part in parts.items()}
    partial = path.with_suffix(".part")
    torch.save({"config": dict(config), "epoch": epoch, "states": states}, partial)
    partial.replace(path)


def restore(path: Path, config: Mapping[str, Any], parts: Mapping[str, Any]) -> int:
    """Load the states into ``parts``. Returns the epoch to go on from; 0 without a state of this configuration."""
    if not path.exists():
        return 0
    state = torch.load(path, weights_only=True)
    if state["config"] != dict(config):
        return 0
    for name, part in parts.items():
        part.load_state_dict(state["states"][name])
    return int(state["epoch"])
