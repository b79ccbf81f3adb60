"""Mixtures by ratio (eq. 2.5), the factorial of Table 2.2, runs that are continued."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from models.synthesis import __main__ as synthesis_command
from models.synthesis.datasets import Mixture, exact_counts, load, samples_in, write_sample
from models.training.foreground import mixture
from models.training.foreground.mixture import Ledger, factorial_arms, factorial_table, run_all
from models.training.foreground.networks import build
from models.training.foreground.short_trainings import Pictures, stack

pytestmark = [pytest.mark.slow, pytest.mark.no_cover]  # of training: nothing there is measured


def mixed(sizes: tuple[int, ...], weights: tuple[float, ...], seed: int = 0) -> Mixture:
    return Mixture(sizes, weights, np.random.default_rng(seed))


def dark_and_bright(count: int, value: int) -> Pictures:
    return Pictures(
        torch.full((count, 3, 32, 32), value, dtype=torch.uint8),
        torch.zeros((count, 32, 32)).byte(),
    )


def test_counts_are_exact_and_the_seed_decides():
    drawn = mixed((50, 20), (0.8, 0.2)).draw(100)
    assert Counter(source for source, _ in drawn) == {0: 80, 1: 20}
    assert drawn == mixed((50, 20), (0.8, 0.2)).draw(100)
    assert drawn != mixed((50, 20), (0.8, 0.2), 1).draw(100)


def test_counts_that_do_not_divide_are_rounded_by_largest_remainder():
    assert exact_counts(10, np.array([1 / 3, 1 / 3, 1 / 3])) == [4, 3, 3]
    assert exact_counts(7, np.array([0.9, 0.1])) == [6, 1]
    assert exact_counts(5, np.array([1.0, 0.0])) == [5, 0]


def test_nothing_comes_twice_before_all_came_once():
    drawn = mixed((10, 5), (0.5, 0.5)).draw(20)
    assert Counter(number for source, number in drawn if source == 0) == dict.fromkeys(range(10), 1)
    assert Counter(number for source, number in drawn if source == 1) == dict.fromkeys(range(5), 2)


@pytest.mark.parametrize(
    ("sizes", "weights"),
    [((3, 0), (0.5, 0.5)), ((3, 3), (0, 0)), ((3, 3), (2, -1)), ((3,), (1, 1))],
)
def test_weights_and_sizes_that_make_no_mixed(sizes, weights):
    with pytest.raises(ValueError, match="source"):
        mixed(sizes, weights)


def test_an_empty_source_of_weight_zero_is_no_error():
    assert {source for source, _ in mixed((3, 0), (1, 0)).draw(9)} == {0}


def test_the_factorial_has_the_cells_and_ratios_of_table_2_2():
    arms = factorial_arms(dark_and_bright(160, 0), dark_and_bright(20, 255), scale=0.01, runs=3)
    assert len(arms) == 27
    arm = arms["s4000_r1000_run2"]()
    assert [len(source.images) for source in arm.sources] == [40, 10]
    assert arm.weights == pytest.approx((0.8, 0.2))
    assert arms["s16000_r1000_run0"]().weights[1] == pytest.approx(0.0588, abs=1e-4)
    assert arms["s8000_r0_run0"]().weights == (1.0, 0.0)
    assert arm.sources[1].images.min() == 255


def test_the_table_shows_mean_and_deviation():
    runs = {f"s4000_r1000_run{k}": {"dice": {"all": score}} for k, score in enumerate((80.0, 84.0))}
    table = factorial_table(runs)
    assert "82.00 ± 2.00 w_r 0.20" in table
    assert len(table.splitlines()) == 4


def test_finished_runs_are_not_run_again(tmp_path):
    trained = []

    def train(arm: str) -> dict:
        if arm == "c":
            raise KeyboardInterrupt
        trained.append(arm)
        return {"dice": {"all": 1.0}}

    arms = {name: (lambda n=name: n) for name in "abc"}
    with pytest.raises(KeyboardInterrupt):
        run_all(arms, Ledger(tmp_path / "runs.json", {"width": 1}), train)
    run_all(
        {name: arms[name] for name in "ab"}, Ledger(tmp_path / "runs.json", {"width": 1}), train
    )
    assert trained == ["a", "b"]
    with pytest.raises(ValueError, match="other settings"):
        Ledger(tmp_path / "runs.json", {"width": 2})


def test_what_the_renderer_writes_is_a_set(tmp_path, monkeypatch):
    size = ["--width", "96", "--height", "64"]
    monkeypatch.setattr(
        "sys.argv", ["synthesis", "render", str(tmp_path), "--count", "2", "--clutter", "0", *size]
    )
    synthesis_command.main()
    loaded = [load(sample) for sample in samples_in(tmp_path)]
    assert [rgb.shape for rgb, _ in loaded] == [(64, 96, 3)] * 2
    assert stack(mixture.from_folder(tmp_path), (32, 64)).images.shape == (2, 3, 32, 64)


def test_the_commands_train_measure_and_continue(tmp_path, capsys):
    rng = np.random.default_rng(0)
    for k in range(4):
        ids = np.zeros((32, 64), np.uint8)
        ids[10 + k : 20 + k] = 1
        write_sample(
            tmp_path / "set", f"c{k % 2}_{k}", rng.integers(0, 255, (32, 64, 3), np.uint8), ids
        )
    out, folder = str(tmp_path / "runs.json"), str(tmp_path / "set")
    common = [
        "--minutes-per-run",
        "0.003",
        "--width",
        "64",
        "--height",
        "32",
        "--test",
        folder,
        "--out",
        out,
    ]
    command = ["compare", f"a={folder}", f"b={folder}", *common]
    assert mixture.main(command) == 0
    first = json.loads((tmp_path / "runs.json").read_text())["runs"]
    assert set(first) == {"a_run0", "b_run0"}
    assert set(first["a_run0"]["dice"]) == {"all", "c0", "c1"}
    assert first["a_run0"]["pictures"] > 0
    assert mixture.main(command) == 0
    assert json.loads((tmp_path / "runs.json").read_text())["runs"] == first
    capsys.readouterr()
    assert mixture.main(["factorial", "--real", folder, "--scale", "0.01", *common]) == 1
    assert "4 pictures, --scale 0.01 needs 20" in capsys.readouterr().out


def test_networks_are_compared_on_the_same_pictures(tmp_path, capsys):
    out = str(tmp_path / "runs.json")
    common = [
        "--minutes-per-run",
        "0.001",
        "--width",
        "64",
        "--height",
        "32",
        "--batch",
        "2",
        "--out",
        out,
    ]
    names = ["compact", "deeplab_resnet50/8"]
    assert (
        mixture.main(
            ["networks", *names, "--count", "3", "--test", str(one_picture(tmp_path)), *common]
        )
        == 0
    )
    runs = json.loads((tmp_path / "runs.json").read_text())["runs"]
    trained = ["compact_run0", "deeplab_resnet50/8_run0"]
    assert list(runs) == ["no network", *(f"untrained {key}" for key in trained), *trained]
    assert runs["compact_run0"]["parameters"] == sum(
        p.numel() for p in build("compact").parameters()
    )
    assert runs["untrained compact_run0"]["pictures"] == 0 < runs["compact_run0"]["pictures"]
    assert set(runs["no network"]["dice"]) == {"a", "all"}
    assert "deeplab_resnet50/8_run0" in capsys.readouterr().out
    assert mixture.main(["networks", "nobody", "--count", "3", *common, "--out", out + "2"]) == 1
    assert "unknown network 'nobody'" in capsys.readouterr().out


def one_picture(folder: Path) -> Path:
    ids = np.zeros((32, 64), np.uint8)
    ids[10:20] = 1
    write_sample(folder / "one", "a_0", np.zeros((32, 64, 3), np.uint8), ids)
    return folder / "one"


def test_with_marked_photographs_those_kept_aside_are_measured_too(tmp_path):
    rng = np.random.default_rng(0)
    labels = np.full((32, 64), 128, np.uint8)
    labels[10:20] = 255
    for folder in ("imgs", "masks"):
        (tmp_path / folder).mkdir()
    for k in range(40):
        cv2.imwrite(
            str(tmp_path / "imgs" / f"table_{k}.png"), rng.integers(0, 255, (32, 64, 3), np.uint8)
        )
        cv2.imwrite(str(tmp_path / "masks" / f"table_{k}.png"), labels)
    out = tmp_path / "runs.json"
    test = ["--test", str(one_picture(tmp_path / "test")), "--out", str(out)]
    common = [
        "--minutes-per-run",
        "0.0005",
        "--width",
        "64",
        "--height",
        "32",
        "--batch",
        "2",
        *test,
    ]
    assert (
        mixture.main(
            ["factorial", "--real", str(tmp_path), "--marked", "--scale", "0.001", *common]
        )
        == 0
    )
    runs = json.loads(out.read_text())["runs"]
    assert len(runs) == 9
    assert {tuple(run["photographs"]) for run in runs.values()} == {("all", "table")}
    assert "±" in factorial_table(runs, "photographs")


def test_where_nobody_can_tell_nothing_counts():
    labels = np.full((32, 64), 128, np.uint8)
    labels[10:20] = 255

    picture = ("a", np.zeros((32, 64, 3), np.uint8), labels)
    assert mixture.dice(lambda rgb: np.ones(rgb.shape[:2], bool), [picture]) == {"all": 100.0}
