"""torch to ONNX, with a parity check and a manifest entry; the only way a weight file gets into the repo."""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import tomli_w
import torch
from torch import Tensor, nn

from models.inference import WEIGHTS


@dataclass(frozen=True)
class Card:
    """What the manifest says of a network besides what can be read off its file."""

    version: str
    task: str
    default: bool
    input: str
    license: str
    origin: str
    preprocess: Mapping[str, Any]
    training: Mapping[str, Any]
    metrics: Mapping[str, float]


def export(
    module: nn.Module, name: str, card: Card, examples: Sequence[Tensor], dynamic: Mapping[int, Any], tolerance: float
) -> float:  # fmt: skip
    """Write ``weights/<name>.onnx`` and its entry. ``examples``: inputs of several sizes, the first is traced;
    ``dynamic``: axis to ``torch.export.Dim``. Returns the largest difference to torch over all examples.

    Raises ValueError when it is above ``tolerance``; then nothing is registered.
    """
    module = module.eval().cpu()
    path = WEIGHTS / f"{name}.onnx"
    torch.onnx.export(
        module, (examples[0],), str(path), dynamo=True, dynamic_shapes=(dict(dynamic),), external_data=False,
        input_names=["input"], output_names=["output"],
    )  # fmt: skip
    _strip(path)
    difference = parity(module, path, examples)
    if difference > tolerance:
        path.unlink()
        raise ValueError(f"{name}: ONNX differs from torch by {difference:.2e}, more than {tolerance:.2e}")
    _register(name, path, card, sum(p.numel() for p in module.parameters()), difference)
    return difference


def _strip(path: Path) -> None:
    """Take out what the exporter notes for debugging: stack traces with the paths of this machine."""
    model = onnx.load(path)
    graphs = [model.graph, *model.functions]
    for graph in graphs:
        del graph.metadata_props[:]
        for part in (*graph.node, *getattr(graph, "initializer", ()), *graph.value_info):
            del part.metadata_props[:]
            part.doc_string = ""
    for value in (*model.graph.input, *model.graph.output):
        del value.metadata_props[:]
    del model.metadata_props[:]
    onnx.save(model, path)


def parity(module: nn.Module, path: Path, examples: Sequence[Tensor]) -> float:
    """Largest absolute difference between ``module`` and the exported file over ``examples``."""
    session = onnxruntime.InferenceSession(path.read_bytes(), providers=["CPUExecutionProvider"])
    name = session.get_inputs()[0].name
    worst = 0.0
    for example in examples:
        with torch.no_grad():
            expected = module(example).numpy()
        got = np.asarray(session.run(None, {name: example.numpy()})[0])
        worst = max(worst, float(np.abs(got - expected).max(initial=0.0)))
    return worst


def _register(name: str, path: Path, card: Card, parameters: int, difference: float) -> None:
    file = WEIGHTS / "manifest.toml"
    entries = tomllib.loads(file.read_text()) if file.exists() else {}
    data = path.read_bytes()
    entries[name] = {
        "version": card.version,
        "task": card.task,
        "default": card.default,
        "file": path.name,
        "sha256": hashlib.sha256(data).hexdigest(),
        "bytes": len(data),
        "parameters": parameters,
        "input": card.input,
        "license": card.license,
        "origin": card.origin,
        "preprocess": dict(card.preprocess),
        "training": dict(card.training),
        "metrics": {**card.metrics, "onnx_difference": difference},
    }
    file.write_text(tomli_w.dumps(dict(sorted(entries.items()))))
