"""The manifest, the check of every file, and ONNX against torch."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from models.disentangling.evidence import MOVE_FEATURES
from models.topology.evidence import FEATURES
from models.training import export
from models.weights import inference
from models.weights.inference import CorruptWeightsError, FeaturesDifferError, UnknownNetworkError
from tests.processes import ROOT


def test_networks_report_nothing_to_anybody(tmp_path):
    """ONNX Runtime kept an id of the machine in the home folder, and a thread that sends its use to
    its maker."""
    program = "from models.weights import inference\ninference.load('ariadne_plus_triplet')\n"
    plain = {
        "HOME": str(tmp_path),
        "PATH": os.environ["PATH"],
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT,
        env=plain,
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    assert list(tmp_path.iterdir()) == []
    assert "elemetry" not in done.stderr


def test_every_shipped_file_is_the_one_in_the_manifest():
    files = {path.name for path in inference.WEIGHTS.glob("*.onnx")}
    entries = inference.manifest().values()
    assert {spec.file for spec in entries} == files
    for spec in entries:
        data = (inference.WEIGHTS / spec.file).read_bytes()
        assert hashlib.sha256(data).hexdigest() == spec.sha256
        assert len(data) == spec.bytes
        assert spec.origin
        assert spec.license
        assert spec.training["seed"] is not None
        assert spec.metrics
    assert sum(spec.bytes for spec in entries) < 120e6


def test_no_shipped_file_tells_of_the_machine_that_made_it():
    """The exporter writes stack traces into the file."""
    for spec in inference.manifest().values():
        data = (inference.WEIGHTS / spec.file).read_bytes()
        assert b"stack_trace" not in data
        assert b"models/segmentation" not in data


@pytest.mark.parametrize("task", ["foreground", "orientation"])
def test_each_task_has_one_default(task):
    assert [s.default for s in inference.manifest().values() if s.task == task].count(True) == 1
    assert inference.manifest()[inference.default_name(task)].task == task


def test_foreground_network_runs_at_other_sizes():
    network = inference.load(inference.default_name("foreground"))
    for height, width in ((32, 32), (192, 320), (384, 640)):
        logits = network(np.zeros((1, 3, height, width), np.float32))
        assert logits.shape == (1, 1, height, width)
        assert np.isfinite(logits).all()


def test_an_unknown_name_is_refused():
    with pytest.raises(UnknownNetworkError, match="nobody"):
        inference.load("nobody")
    with pytest.raises(UnknownNetworkError):
        inference.default_name("nothing")


class Doubler(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.factor = nn.Parameter(torch.tensor(2.0))

    def forward(self, x: Tensor) -> Tensor:
        """(n, 3) to (n, 3)."""
        return x * self.factor


CARD = export.Card(
    version="1",
    task="test",
    default=True,
    input="(n, 3)",
    license="Apache-2.0",
    origin="a test",
    preprocess={},
    training={"seed": 0},
    metrics={},
)


@pytest.fixture
def weights(tmp_path, monkeypatch):
    monkeypatch.setattr(inference, "WEIGHTS", tmp_path)
    monkeypatch.setattr(export, "WEIGHTS", tmp_path)
    inference.manifest.cache_clear()
    yield tmp_path
    inference.manifest.cache_clear()


@pytest.mark.slow
def test_export_registers_what_can_then_be_loaded(weights):
    examples = [torch.rand(n, 3) for n in (4, 2, 9)]
    difference = export.export(
        Doubler(), "doubler", CARD, examples, {0: torch.export.Dim("n")}, 1e-6
    )
    assert difference == 0.0
    network = inference.load("doubler")
    assert network(np.ones((5, 3), np.float32)).tolist() == [[2.0] * 3] * 5
    assert network.spec.parameters == 1


def test_a_network_that_weighs_other_columns_is_refused_by_their_names():
    """A vector of unnamed numbers in another order was weighed without a word."""
    for name, spec in inference.manifest().items():
        if spec.task in (*FEATURES, "moves"):
            columns = MOVE_FEATURES if spec.task == "moves" else FEATURES[spec.task]
            network = inference.load(name)
            assert network.weighing(columns) is network
            with pytest.raises(
                FeaturesDifferError, match=rf"{name} .*lacks \['new'\], expects \['{columns[0]}'\]"
            ):
                network.weighing(("new", *columns[1:]))
            with pytest.raises(FeaturesDifferError, match="another order"):
                network.weighing(columns[::-1])


class Adder(nn.Module):
    def forward(self, nodes: Tensor, edges: Tensor) -> tuple[Tensor, Tensor]:
        """(n, 3) and (2, e) to (n, 3), the sums of the nodes' neighbors, and (n,) their degrees."""
        sums = torch.zeros_like(nodes).index_add(0, edges[1], nodes[edges[0]])
        return sums, nodes.new_zeros(nodes.shape[0]).index_add(
            0, edges[1], torch.ones(edges.shape[1])
        )


@pytest.mark.slow
def test_a_network_with_several_inputs_and_outputs(weights):
    """Message passing over any number of nodes and edges, none included."""
    cases = [(torch.rand(n, 3), torch.randint(0, n, (2, e))) for n, e in ((5, 7), (2, 3), (4, 0))]
    axes = [{0: torch.export.Dim("nodes")}, {1: torch.export.Dim("edges")}]
    export.export(
        Adder(), "adder", CARD, cases, axes, 1e-6, ("nodes", "edges"), ("sums", "degrees")
    )
    edges = np.array([[0, 1], [2, 2]])
    sums, degrees = inference.load("adder").run(np.eye(3, dtype=np.float32), edges)
    assert sums.tolist() == [[0, 0, 0], [0, 0, 0], [1, 1, 0]]
    assert degrees.tolist() == [0, 0, 2]
    with pytest.raises(ValueError, match="shorter"):
        inference.load("adder").run(edges)


@pytest.mark.slow
def test_a_changed_file_is_refused(weights):
    export.export(Doubler(), "doubler", CARD, [torch.rand(4, 3)], {0: torch.export.Dim("n")}, 1e-6)
    path = weights / "doubler.onnx"
    path.write_bytes(path.read_bytes() + b"\0")
    with pytest.raises(CorruptWeightsError, match=r"doubler\.onnx"):
        inference.load("doubler")


@pytest.mark.slow
def test_an_export_that_differs_is_not_registered(weights):
    class Noisy(Doubler):
        def forward(self, x: Tensor) -> Tensor:
            return x * self.factor + (0.0 if torch.compiler.is_exporting() else 0.5)

    with pytest.raises(ValueError, match="differs"):
        export.export(Noisy(), "noisy", CARD, [torch.rand(4, 3)], {0: torch.export.Dim("n")}, 1e-6)
    assert not (weights / "noisy.onnx").exists()
    assert not (weights / "manifest.toml").exists()


@pytest.mark.parametrize("name", sorted(inference.manifest()))
def test_every_network_has_beside_its_figures_what_there_would_be_without_it(name):
    spec = inference.manifest()[name]
    assert spec.without["rule"]
    assert len(spec.without) > 1
    assert {figure for figure in spec.without if figure != "rule"} <= set(spec.metrics)
