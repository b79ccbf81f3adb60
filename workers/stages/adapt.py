"""``adapt``: labelled pictures of one place to a foreground network that knows it.

Strategy: learning is a process of its own (``models.training.foreground.adaptation``), so that
torch is loaded by those who train and dies with its job. Its folder is named after what is asked
for: the same request, after a cancel or a crash, finds the checkpoint there and goes on. What is
not accepted is never stored.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from dlo_client.contracts.adaptation import (
    AdaptRequest,
    AdaptResult,
    AsidePicture,
    Overlap,
    Retained,
)
from dlo_client.contracts.networks import NetworkCard, Preprocess

from models.weights.foreign import fit_foreground
from models.weights.inference import WEIGHTS, NetworkSpec
from workers.networks.store import NetworkStore
from workers.stages.encoding import File, model_used
from workers.stages.labelled_pictures import unpacked
from workers.stages.networks import NoSuchNetworkError, spec_of
from workers.stages.outcome import InvalidInput, Outcome, Tools
from workers.stages.storing import check_name, store_as

TRAINABLE = ("compact", "dense", "dense_large")
"""Architectures whose exported networks can be trained further."""
_COMMAND = "models.training.foreground.adaptation"
_KEPT_S = 7 * 86_400.0
"""How long the folder of a training that was cut off waits for the same request."""
_PREPARED, _LEARNT = 0.03, 0.97
_FEW = 10


def run(request: AdaptRequest, tools: Tools) -> Outcome:
    """Raises InvalidInput naming ``labels``, ``name`` or ``parent``."""
    assert tools.store is not None
    assert tools.training_dir is not None
    check_name(request.name, "name", tools.store, tools.owner)
    parent, data = _parent(request, tools, tools.store)
    _sweep(tools.training_dir)
    folder = tools.training_dir / _key(request, parent)
    warnings = _prepare(folder, request, parent, data, tools)
    tools.progress(_PREPARED)
    report = _learn(folder, request, parent, tools)
    result = _result(request, parent, report, warnings)
    if not report["refused"]:
        result = _stored(
            result, request, (folder / "network.onnx").read_bytes(), parent, report, tools
        )
    files = {
        file.name: ("image/png", file.read_bytes()) for file in sorted(folder.glob("worst_*.png"))
    }
    shutil.rmtree(folder, ignore_errors=True)
    return Outcome(result, _with_report(files, report), {"learn": 1000.0 * report["seconds"]})


def _parent(request: AdaptRequest, tools: Tools, store: NetworkStore) -> tuple[NetworkSpec, bytes]:
    """What is known of the parent, and its ONNX file."""
    try:
        spec = tools.weights.foreground(request.parent).spec
    except NoSuchNetworkError as error:
        raise InvalidInput("parent", str(error), "invalid_model") from error
    if _architecture(spec) not in TRAINABLE:
        raise InvalidInput(
            "parent", f"{spec.name} is of a kind that cannot be trained further", "invalid_model"
        )
    data = (
        (WEIGHTS / spec.file).read_bytes()
        if spec.file
        else store.onnx(spec.name, int(spec.version))
    )
    return spec, data


def _architecture(spec: NetworkSpec) -> str:
    if spec.name.endswith("_int8"):
        return "unknown"
    return str(spec.training.get("network", "compact"))


def _key(request: AdaptRequest, parent: NetworkSpec) -> str:
    """The same for the same task, whoever gives it and however long it may wait."""
    told = (request.name, request.labels.id, parent.sha256, request.minutes, request.keep_aside)
    return hashlib.sha256(repr(told).encode()).hexdigest()[:32]


def _prepare(
    folder: Path, request: AdaptRequest, parent: NetworkSpec, data: bytes, tools: Tools
) -> list[str]:
    """Pictures and parent, where the training looks for them. Returns what limits the result."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    os.utime(folder)
    count = unpacked(request.labels, folder, tools)
    (folder / "parent.onnx").write_bytes(data)
    (folder / "preprocess.json").write_text(json.dumps(dict(parent.preprocess)))
    if count < _FEW:
        return [
            f"{count} pictures are few: how good the network is, was measured on very few of them"
        ]
    return []


def _learn(
    folder: Path, request: AdaptRequest, parent: NetworkSpec, tools: Tools
) -> dict[str, Any]:
    command = [
        sys.executable,
        "-m",
        _COMMAND,
        str(folder),
        "--parent",
        str(folder / "parent.onnx"),
        "--network",
        _architecture(parent),
        "--preprocess",
        str(folder / "preprocess.json"),
        "--minutes",
        str(request.minutes),
        "--keep-aside",
        str(request.keep_aside),
        "--threads",
        str(tools.runtime.threads or os.cpu_count() or 1),
        *tools.training_options,
    ]
    with (folder / "training.log").open("w") as log:
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=log, stdin=subprocess.DEVNULL, text=True
        )
        last = _followed(process, tools.progress)
    if process.returncode == 2 and "problem" in last:
        raise InvalidInput("labels", str(last["problem"]), "invalid_labels")
    if process.returncode:
        tail = (folder / "training.log").read_text(errors="replace")[-2000:]
        raise RuntimeError(f"the training ended with {process.returncode}: {tail}")
    report: dict[str, Any] = json.loads((folder / "report.json").read_text())
    return report


def _followed(process: subprocess.Popen[str], progress: Callable[[float], None]) -> dict[str, Any]:
    """The last line of the process, once it has ended."""
    last: dict[str, Any] = {}
    assert process.stdout is not None
    with process.stdout as lines:
        for line in lines:
            last = json.loads(line)
            if "progress" in last:
                progress(_PREPARED + (_LEARNT - _PREPARED) * float(last["progress"]))
    process.wait()
    return last


def _result(
    request: AdaptRequest, parent: NetworkSpec, report: dict[str, Any], warnings: list[str]
) -> AdaptResult:
    aside = sorted(report["kept_aside"], key=lambda row: float(row["after"]))
    return AdaptResult(
        accepted=not report["refused"],
        refused=report["refused"],
        model=None,
        version=None,
        in_service=False,
        before=Overlap(dice=round(report["before"], 2)),
        after=Overlap(dice=round(report["after"], 2)),
        general=Retained(
            before=round(report["general_before"], 2), after=round(report["general_after"], 2)
        ),
        trained_on=report["pictures"],
        kept_aside=[
            AsidePicture(
                name=row["name"], before=round(row["before"], 2), after=round(row["after"], 2)
            )
            for row in aside
        ],
        kept_share=report["share"],
        minutes=round(report["seconds"] / 60, 2),
        warnings=warnings,
        models=[model_used(parent)],
    )


def _stored(
    result: AdaptResult,
    request: AdaptRequest,
    onnx: bytes,
    parent: NetworkSpec,
    report: dict[str, Any],
    tools: Tools,
) -> AdaptResult:
    """The result with the place where the network is now."""
    assert tools.store is not None
    card = NetworkCard(
        name=request.name,
        architecture=_architecture(parent),
        parent=f"{parent.name}@{parent.version}",
        sha256=hashlib.sha256(onnx).hexdigest(),
        parameters=parent.parameters,
        origin=f"{parent.name} adapted to {report['pictures']} labelled pictures of one place",
        license=parent.license,
        preprocess=Preprocess.model_validate(dict(parent.preprocess)),
        metrics={
            "dice_before": result.before.dice,
            "dice_after": result.after.dice,
            "general_before": result.general.before,
            "general_after": result.general.after,
        },
        created_at=datetime.now(UTC),
    )
    fit_foreground(spec_of(card, request.name, "0", len(onnx)), onnx, tools.runtime)
    version = store_as(card, onnx, request.name, "name", tools)
    if request.use:
        tools.store.use(request.name, version)
    serves = tools.store.find(request.name) == (request.name, version)
    return result.model_copy(
        update={"model": request.name, "version": version, "in_service": serves}
    )


def _with_report(files: dict[str, File], report: dict[str, Any]) -> dict[str, File]:
    return {**files, "report.json": ("application/json", json.dumps(report, indent=1).encode())}


def _sweep(folder: Path) -> None:
    """Forget trainings that were cut off long ago and that nobody has asked for again."""
    for old in folder.glob("*"):
        if old.is_dir() and old.stat().st_mtime < time.time() - _KEPT_S:
            shutil.rmtree(old, ignore_errors=True)
