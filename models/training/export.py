"""torch to ONNX, with a parity check and a manifest entry; the only way a weight file gets into the
repo."""

from __future__ import annotations

import hashlib
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import tomli_w
import torch
from torch import Tensor, nn

from models.weights.inference import WEIGHTS, Card, NetworkSpec, manifest


@dataclass(frozen=True)
class Exported:
    """A file to write: ``module``, the task it serves and what a caller needs to feed it.

    ``examples``: inputs of several sizes, the first is traced; ``dynamic``: free axes of every
    input; ``features``: names of the columns where the input is a row of evidence; ``facts``: what
    else the manifest notes of the training.
    """

    name: str
    module: nn.Module
    task: str
    input: str
    origin: str
    preprocess: Mapping[str, Any]
    examples: Sequence[tuple[Tensor, ...]]
    dynamic: Sequence[Mapping[int, Any]]
    tolerance: float
    inputs: Sequence[str] = ("input",)
    outputs: Sequence[str] = ("output",)
    version: str = "1.0"
    features: Sequence[str] = ()
    facts: Mapping[str, Any] = field(default_factory=dict)


def refuse_useless(name: str, metrics: Mapping[str, float], least: Mapping[str, float]) -> None:
    """Raises ValueError for a network that is no better than a guess: it must not replace the one
    that ships."""
    for figure, bound in least.items():
        if not metrics.get(figure, math.nan) > bound:
            raise ValueError(
                f"{name} is not exported: {figure} is {metrics.get(figure)}, no more than {bound}"
            )


def publish(
    exported: Exported,
    training: Mapping[str, Any],
    metrics: Mapping[str, float],
    without: Mapping[str, Any],
) -> float:
    """Write a trained network's file and its manifest entry; returns the largest difference to
    torch."""
    card = Card(
        exported.version,
        exported.task,
        True,
        exported.input,
        "Apache-2.0",
        exported.origin,
        exported.preprocess,
        {**training, **exported.facts},
        metrics,
        exported.features,
        without,
    )
    return export(
        exported.module,
        exported.name,
        card,
        exported.examples,
        exported.dynamic,
        exported.tolerance,
        exported.inputs,
        exported.outputs,
    )


def export(
    module: nn.Module,
    name: str,
    card: Card,
    examples: Sequence[Tensor | tuple[Tensor, ...]],
    dynamic: Mapping[int, Any] | Sequence[Mapping[int, Any]],
    tolerance: float,
    inputs: Sequence[str] = ("input",),
    outputs: Sequence[str] = ("output",),
) -> float:
    """Write ``weights/<name>.onnx`` and its entry. Returns the largest difference to torch over all
    examples.

    ``examples``: inputs of several sizes, the first is traced; ``dynamic``: axis to
    ``torch.export.Dim``, a mapping an input where there are several. ``inputs`` and ``outputs``
    name them in the order of ``forward``. A module traced by ``make_fx`` holds its weights as
    constants: they are counted with its parameters.

    Raises ValueError when the difference is above ``tolerance``; then nothing is registered.
    """
    module = module.eval().cpu()
    path = WEIGHTS / f"{name}.onnx"
    cases = [example if isinstance(example, tuple) else (example,) for example in examples]
    shapes = [dynamic] if isinstance(dynamic, Mapping) else dynamic
    torch.onnx.export(
        module,
        cases[0],
        str(path),
        dynamo=True,
        dynamic_shapes=tuple(dict(axes) for axes in shapes),
        external_data=False,
        input_names=list(inputs),
        output_names=list(outputs),
    )
    _strip(path)
    difference = parity(module, path, cases)
    if difference > tolerance:
        path.unlink()
        raise ValueError(
            f"{name}: ONNX differs from torch by {difference:.2e}, more than {tolerance:.2e}"
        )
    weights = [
        *module.parameters(),
        *(b for b in module.buffers() if b.is_floating_point() and _traced(module)),
    ]
    measured = {**card.metrics, "onnx_difference": difference}
    register(name, path, replace(card, metrics=measured), sum(p.numel() for p in weights))
    return difference


def _traced(module: nn.Module) -> bool:
    return isinstance(module, torch.fx.GraphModule)


def _strip(path: Path) -> None:
    """Take out what the exporter notes for debugging: stack traces with the paths of this
    machine."""
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


def parity(module: nn.Module, path: Path, cases: Sequence[tuple[Tensor, ...]]) -> float:
    """Largest absolute difference between ``module`` and the exported file over ``cases`` and all
    outputs."""
    session = onnxruntime.InferenceSession(path.read_bytes(), providers=["CPUExecutionProvider"])
    names = [i.name for i in session.get_inputs()]
    worst = 0.0
    for case in cases:
        with torch.no_grad():
            expected = module(*case)
        got = session.run(None, dict(zip(names, (tensor.numpy() for tensor in case), strict=True)))
        for ours, theirs in zip(
            expected if isinstance(expected, tuple) else (expected,), got, strict=True
        ):
            worst = max(worst, float(np.abs(np.asarray(theirs) - ours.numpy()).max(initial=0.0)))
    return worst


def note_without(name: str, without: Mapping[str, Any]) -> None:
    """Write into the manifest what there would be without a network that ships."""
    spec = manifest()[name]
    register(name, WEIGHTS / spec.file, replace(spec, without=without), spec.parameters)
    manifest.cache_clear()


def register(name: str, path: Path, card: Card, parameters: int) -> None:
    """Write, or write anew, the manifest's entry of the file at ``path``."""
    file = WEIGHTS / "manifest.toml"
    entries = tomllib.loads(file.read_text()) if file.exists() else {}
    data = path.read_bytes()
    if card.default:
        for entry in entries.values():
            entry["default"] = entry["default"] and entry["task"] != card.task
    spec = NetworkSpec(
        name=name,
        file=path.name,
        sha256=hashlib.sha256(data).hexdigest(),
        bytes=len(data),
        parameters=parameters,
        **{field.name: getattr(card, field.name) for field in fields(Card)},
    )
    empty = [name for name in ("features", "without") if not getattr(spec, name)]
    entries[name] = {
        key: value for key, value in asdict(spec).items() if key not in ("name", *empty)
    }
    file.write_text(tomli_w.dumps(dict(sorted(entries.items()))))
