"""One loop for every network: a tiny training of each, going on after a stop, and what is
refused."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from torch import nn

from models.manipulation.simulator import Ropes
from models.synthesis.textures import load_pool
from models.training import command, export, fit, state
from models.training.__main__ import main
from models.training.corrector import crops
from models.training.disentangling import moves
from models.training.dynamics.data import generate
from models.training.export import Exported
from models.training.families import FAMILIES
from models.training.fit import Family, Source
from models.training.log import Log
from models.training.state import Config, Course, rate_at
from models.weights import inference

pytestmark = [pytest.mark.slow, pytest.mark.no_cover]  # of training: nothing there is measured

TINY = {
    "rt_dlo_orientation": {"patches": 96, "held_out": 48, "batch": 48},
    "fastdlo_similarity": {"crossings": 10, "held_out": 4},
    "ariadne_plus_triplet": {"crossings": 10, "held_out": 4},
    "ariadne_plus_cross": {"crossings": 10, "held_out": 4},
    "labelling_corrector": {"batch": 8, "width": 0.125},
    "dynamics": {"minutes": 0.002, "batch": 16},
    "topology": {"scenes": 3, "held_out": 2},
    "topology_stubs": {"scenes": 3, "held_out": 2},
    "topology_bridges": {"scenes": 3, "held_out": 2},
    "topology_junctions": {"scenes": 3, "held_out": 2},
    "topology_moves": {"scenes": 1, "held_out": 1},
}


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """A folder with samples of a renderer's and of the simulator's."""
    folder = tmp_path_factory.mktemp("training")
    crops.write(
        folder / "crops",
        crops.CropParams(scenes=2, per_scene=10, height=192, width=256),
        load_pool(None),
    )
    rng = np.random.default_rng(0)
    generate(rng, 40, 2, Ropes.random(rng, 40)).save(folder / "varied.npz")
    return folder


def of(name: str, folder) -> Source:
    if name == "dynamics":
        return Source(folder, data=folder / "varied.npz")
    return Source(folder, data=folder / "crops", watched=folder / "crops")


def test_the_table_has_every_network_that_is_not_a_foreground_network():
    files = {
        name for name in inference.manifest() if not name.startswith(("foreground", "dynamics_by"))
    }
    assert files == set(FAMILIES) == set(TINY)


@pytest.mark.parametrize("name", list(TINY))
def test_every_network_is_trained_measured_and_ready_for_export(name, source, monkeypatch):
    torch.set_num_threads(1)
    monkeypatch.setattr(moves, "_MOST_STEPS", 1)
    monkeypatch.setattr(moves, "_MOST_TRIED", 4)
    family = FAMILIES[name]
    config = family.config(**{"epochs": 1, **TINY[name]})
    samples, held_out = family.samples(config, of(name, source))
    before = [p.detach().clone() for p in family.build(config, samples).parameters()]
    network = fit.fit(family, config, samples, source / f"{name}.pt")
    assert any(not torch.equal(a, b) for a, b in zip(before, network.parameters(), strict=True))
    metrics = family.measure(network, held_out, config)
    assert set(family.least) <= set(metrics), "what decides on the export is measured"
    without = family.without(held_out, config)
    assert without["rule"]
    assert {figure for figure in without if figure != "rule"} <= set(metrics), "the same figures"
    assert len(without) > 1
    for exported in family.exports(network, samples, config):
        assert inference.manifest()[exported.name].task == exported.task
        assert inference.manifest()[exported.name].input == exported.input
        with torch.no_grad():
            out = exported.module.eval()(*exported.examples[0])
        assert all(
            torch.isfinite(part).all() for part in (out if isinstance(out, tuple) else (out,))
        )


class Line(nn.Module):
    """``x`` to ``w x``, with dropout: its randomness must be taken up again too."""

    def __init__(self) -> None:
        super().__init__()
        self.layer = nn.Linear(1, 1)
        self.dropout = nn.Dropout(0.3)

    def forward(self, x):
        return self.dropout(self.layer(x))


def line_family(**given) -> Family:
    def loss(network, samples, rows, rng, config):
        x = torch.from_numpy(samples[rows] + rng.normal(0, 0.1, len(rows)).astype(np.float32))[
            :, None
        ]
        return ((network(x) - 3 * x) ** 2).mean()

    def measure(network, samples, config):
        return {"slope": float(network.layer.weight)}

    def without(samples, config):
        return {"rule": "no slope", "slope": 0.0}

    def exports(network, samples, config):
        return [
            Exported(
                "line",
                network,
                "line",
                "(n, 1)",
                "a test",
                {},
                [(torch.rand(3, 1),)],
                [{0: torch.export.Dim("n")}],
                1e-5,
                features=("x",),
            )
        ]

    def samples(config, source):
        return np.linspace(-1, 1, 64, dtype=np.float32), np.ones(4, np.float32)

    return Family(
        "line",
        Config,
        samples,
        lambda config, samples: Line(),
        loss,
        measure,
        without,
        exports,
        **{"least": {"slope": 2.0}, **given},
    )


def test_a_training_that_was_stopped_ends_in_the_very_network_of_one_that_was_not(tmp_path):
    family, config = line_family(), Config(epochs=4, batch=16, keep=0.9)
    samples, _ = family.samples(config, Source(tmp_path))
    whole = fit.fit(family, config, samples, tmp_path / "whole.pt").state_dict()

    class StoppedError(Exception):
        pass

    def stop(**fields):
        if fields["epoch"] == 2:
            raise StoppedError

    with pytest.raises(StoppedError):
        fit.fit(family, config, samples, tmp_path / "stopped.pt", stop)
    resumed = fit.fit(family, config, samples, tmp_path / "stopped.pt").state_dict()
    for name, value in whole.items():
        torch.testing.assert_close(resumed[name], value, rtol=0, atol=0)


def test_a_state_of_other_settings_is_refused_by_their_name(tmp_path):
    family = line_family()
    samples, _ = family.samples(Config(), Source(tmp_path))
    fit.fit(family, Config(epochs=1), samples, tmp_path / "s.pt")
    with pytest.raises(ValueError, match="begun with batch 64, not 8"):
        fit.fit(family, Config(epochs=1, batch=8), samples, tmp_path / "s.pt")
    longer = fit.fit(family, Config(epochs=2), samples, tmp_path / "s.pt")
    assert longer.layer.weight.shape == (1, 1), "a training can be made longer"


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"epochs": 0}, "epochs"),
        ({"minutes": -1.0}, "epochs"),
        ({"batch": 0}, "batch"),
        ({"rate": 0.0}, "rate"),
        ({"rate": float("nan")}, "rate"),
        ({"warm_up": 1.0}, "warm_up"),
        ({"keep": 1.0}, "keep"),
        ({"warm_up": 0.5, "hold": 0.5}, "hold"),
    ],
)
def test_settings_under_which_a_training_never_ends_or_begins_are_refused(settings, named):
    with pytest.raises(ValueError, match=named):
        Config(**settings)


def test_without_samples_there_is_no_training(tmp_path):
    with pytest.raises(ValueError, match="no samples"):
        fit.fit(line_family(), Config(), np.zeros(0, np.float32), tmp_path / "s.pt")


def test_the_learning_rate_rises_then_falls():
    rates = [rate_at(share, 0.1) for share in (0.0, 0.05, 0.1, 0.5, 1.0)]
    assert rates == pytest.approx(
        [0.05, 0.525, 1.0, 0.01 + 0.495 * (1 + np.cos(np.pi * 4 / 9)), 0.01]
    )
    assert rate_at(0.0, 0.0) == 1.0
    held = [rate_at(share, 0.1, 0.5) for share in (0.05, 0.1, 0.59, 0.8, 1.0)]
    assert held == pytest.approx([0.525, 1.0, 1.0, 0.505, 0.01])


def test_the_running_mean_follows_the_weights_slowly():
    course = Course(Line(), Config(keep=0.9, rate=1.0))
    begun = float(course.average.layer.weight)
    for _ in range(100):
        course.step((course.network.layer.weight - 50).square().sum())
    now, mean = course.network.layer.weight.item(), course.average.layer.weight.item()
    assert begun < mean < now, "it moves, and it lags"


@pytest.fixture
def weights(tmp_path, monkeypatch):
    for module in (inference, export):
        monkeypatch.setattr(module, "WEIGHTS", tmp_path)
    inference.manifest.cache_clear()
    yield tmp_path
    inference.manifest.cache_clear()


def test_the_command_trains_measures_logs_and_exports(weights, tmp_path):
    folder = tmp_path / "state"
    metrics = command.run(line_family(), Config(epochs=40, batch=16, rate=0.1), Source(folder))
    assert metrics["slope"] > 2
    lines = [json.loads(line) for line in (folder / "line.jsonl").read_text().splitlines()]
    assert [line["epoch"] for line in lines[:40]] == list(range(1, 41))
    assert lines[-1]["onnx_difference"] < 1e-5
    entry = inference.manifest()["line"]
    assert entry.training["command"] == "python -m models.training line"
    assert entry.metrics["slope"] == pytest.approx(metrics["slope"])
    assert entry.features == ["x"]


def test_a_network_that_is_no_better_than_a_guess_is_not_exported(weights, tmp_path):
    """A network with Dice 0 replaced the shipped one without a word."""
    with pytest.raises(ValueError, match="line is not exported: slope is"):
        command.run(line_family(), Config(epochs=1, rate=1e-6), Source(tmp_path / "state"))
    assert not (weights / "manifest.toml").exists()
    with pytest.raises(ValueError, match="slope is nan"):
        export.refuse_useless("line", {"slope": float("nan")}, {"slope": 2.0})
    with pytest.raises(ValueError, match="slope is None"):
        export.refuse_useless("line", {}, {"slope": 2.0})


def test_commands_that_cannot_be_done_end_with_a_reason(capsys, tmp_path):
    assert main(["nobody"]) == 2
    assert "fastdlo_similarity" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["fastdlo_similarity", "--epochs", "0"])
    assert "epochs is less than 1" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["ariadne_plus_cross", "--crossings", "5", "--held-out", "5"])
    assert "held_out is 5 of 5 crossings" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["dynamics"])
    assert "--data" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["dynamics", "--data", str(tmp_path), "--network", "nobody"])
    assert "network is 'nobody'; there are dynamics" in capsys.readouterr().err


def test_what_was_made_once_is_kept(tmp_path):
    made = []
    for _ in range(2):
        assert state.kept(tmp_path / "a" / "b.pickle", lambda: made.append(1) or [1, 2]) == [1, 2]
    assert made == [1]


def test_a_log_without_a_file_only_prints(capsys):
    Log()(loss=0.123456, epoch=3)
    assert json.loads(capsys.readouterr().out) == {"loss": 0.1235, "epoch": 3}
