"""The corrector's training data and network: truth of crops, mirrored truth, exported equals
eager."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from models.synthesis.scenes import Labelled, render_scene
from models.synthesis.textures import load_pool
from models.tracked_labels.crops import MIDDLE, SIZE
from models.tracked_labels.lines import LineReading
from models.training.corrector.corrector import (
    FAMILY,
    NAME,
    CorrectorConfig,
    augment,
    corrector_loss,
    errors,
    marked,
)
from models.training.corrector.crops import CropParams, contrast, crops_of, joined, read, write
from models.training.corrector.network_corrector import CorrectorNetwork, CorrectorProbabilities
from models.training.fit import fit
from models.weights.inference import load

pytestmark = [pytest.mark.slow, pytest.mark.no_cover]  # of training: nothing there is measured

PARAMS = CropParams(scenes=2, per_scene=12, height=192, width=256)


def crops(seed=3):
    rng = np.random.default_rng([seed, 0])
    return crops_of(render_scene(rng, PARAMS.scene(), load_pool(None)), rng, PARAMS)


def test_crops_are_the_same_for_the_same_seed_and_say_where_the_dlo_is():
    made, again = crops(), crops()
    assert np.array_equal(made.images, again.images)
    assert len(made.images) == len(made.columns) == len(made.widths) == len(made.margins) > 3
    assert np.abs(made.columns - MIDDLE).max() < 24
    assert np.abs(made.columns - MIDDLE).max() > 3


def test_contrast_is_the_difference_of_colors():
    made = crops()
    flat = replace(made, images=np.full_like(made.images, 90))
    assert contrast(flat).max() == 0
    barred = flat.images.copy()
    for k, (column, width) in enumerate(zip(made.columns, made.widths, strict=True)):
        barred[k, :, max(round(column - width / 2), 0) : round(column + width / 2) + 1] = 190
    assert np.median(contrast(replace(made, images=barred))) > 80


def test_writing_goes_on_where_it_was_cut_off(tmp_path):
    write(tmp_path, PARAMS, load_pool(None))
    (file,) = tmp_path.glob("*.npz")
    before = file.stat().st_mtime_ns
    write(tmp_path, PARAMS, load_pool(None))
    assert file.stat().st_mtime_ns == before
    assert len(read(tmp_path).images) > 6


def test_augmented_crops_keep_their_truth():
    """A bright column is where the moved truth says, whatever light, blur and noise."""
    images = np.zeros((40, SIZE, SIZE, 3), np.uint8)
    columns = np.random.default_rng(0).integers(10, 86, 40).astype(np.float32)
    for image, column in zip(images, columns, strict=True):
        image[:, int(column) - 2 : int(column) + 3] = 255
    moved, at = augment(images, columns, np.random.default_rng(1))
    assert not torch.equal(at, torch.from_numpy(columns))
    light = moved.mean((1, 3))
    lit = (light > light.amax(1, keepdim=True) / 2).float()
    torch.testing.assert_close(
        (lit * torch.arange(SIZE)).sum(1) / lit.sum(1), at, atol=0.01, rtol=0
    )


def test_training_goes_on_and_learns(tmp_path):
    """A few steps on a few crops lower the loss; a state is taken up."""
    many = joined([crops()] * 4)
    config = CorrectorConfig(epochs=12, batch=8, width=0.125, keep=0.5)
    torch.set_num_threads(1)
    network = fit(FAMILY, config, many, tmp_path / "state.pt")
    fresh = CorrectorNetwork(0.125).eval()
    images = torch.from_numpy(many.images).float()
    truth = torch.from_numpy(many.columns), torch.from_numpy(many.widths)
    with torch.no_grad():
        losses = [
            float(corrector_loss(*n(images), *truth, config.heat_px)) for n in (network, fresh)
        ]
    assert losses[0] < losses[1]
    again = fit(FAMILY, config, many, tmp_path / "state.pt")
    assert all(
        torch.equal(a, b) for a, b in zip(network.parameters(), again.parameters(), strict=True)
    )


def test_errors_are_those_of_the_offset():
    """By hand: 1 px too far right, 3.5 too far left, right; half the width, twice the width,
    right."""
    made = crops()
    truth = made.take(np.arange(3))
    offsets = truth.columns - MIDDLE + np.array([1.0, -3.5, 0.0])
    reading = LineReading(offsets, truth.widths * np.array([0.5, 2.0, 1.0]), np.ones(3))
    found = errors(reading, truth)
    assert found["mean_px"] == pytest.approx(-2.5 / 3, abs=1e-3)
    assert found["sd_px"] == pytest.approx(np.std([1.0, -3.5, 0.0]), abs=1e-3)
    assert found["over_3px"] == pytest.approx(1 / 3, abs=1e-3)
    assert found["median_abs_px"] == pytest.approx(1.0, abs=1e-3)
    assert found["width_error"] == pytest.approx(np.log(2), abs=1e-3)


def test_only_crops_that_show_which_dlo_is_meant_are_marked():
    made = crops().take(np.zeros(3, int))
    image = np.full((SIZE, SIZE, 3), 90, np.uint8)
    column, width = made.columns[0], made.widths[0]
    image[:, max(round(column - width / 2), 0) : round(column + width / 2) + 1] = 190
    images = np.stack([image, image, np.full_like(image, 90)])
    three = replace(made, images=images, margins=np.array([4.0, 3.9, 30.0], np.float32))
    assert marked(three).tolist() == [True, False, False]


def scene(lines, ids=None):
    """A picture of 100 × 100 with DLOs 6 px wide; as render_scene says it, as far as crops need
    it."""
    curves = tuple(np.column_stack([line, np.zeros(len(line))]) for line in lines)
    drawn = np.zeros((100, 100), np.int16)
    for k, line in enumerate(lines, start=1):
        for x, y in np.rint(line).astype(int):
            drawn[max(y - 3, 0) : y + 4, max(x - 3, 0) : x + 4] = k
    widths = (6.0,) * len(lines)
    rgb = torch.zeros(3, 100, 100)
    return Labelled(
        rgb, torch.from_numpy(drawn if ids is None else ids), curves, widths, (), (), None
    )


def test_margins_count_other_dlos_and_the_same_one_where_it_comes_back():
    """Two lines 20 px apart, or one that turns and comes back 20 px beside itself: the difference
    of distances."""
    x = np.arange(8.0, 92.0)
    there, back = np.stack([x, np.full(84, 40.0)], 1), np.stack([x[::-1], np.full(84, 60.0)], 1)
    turn = np.stack([np.full(19, 91.0), np.arange(41.0, 60.0)], 1)
    params = CropParams(per_scene=30, error_px=5.0, tilt_rad=0.0)
    for lines in ([there, back], [np.concatenate([there, turn, back])]):
        made = crops_of(scene(lines), np.random.default_rng(0), params)
        straight = np.abs(made.margins - (20 - 2 * np.abs(made.columns - MIDDLE))) < 1.5
        assert straight.mean() > 0.3
        assert made.margins.max() < 45


def test_a_dlo_that_is_covered_on_the_crops_middle_row_gives_no_crop():
    x = np.arange(4.0, 96.0)
    line = np.stack([x, np.full(92, 50.0)], 1)
    covered = np.zeros((100, 100), np.int16)
    made = crops_of(scene([line], covered), np.random.default_rng(0), CropParams())
    assert len(made.images) == 0
    covered[47:54] = 1
    assert len(crops_of(scene([line], covered), np.random.default_rng(0), CropParams()).images) > 3


def test_exported_outputs_are_probabilities_and_widths():
    network = load(NAME)
    for count in (1, 5):
        columns, widths = network.run(
            np.random.default_rng(count).integers(0, 256, (count, SIZE, SIZE, 3), np.uint8)
        )
        assert columns.shape == widths.shape == (count, SIZE)
        np.testing.assert_allclose(columns.sum(1), 1, atol=1e-4)
        assert widths.min() > 0


def test_batched_equals_one_by_one():
    torch.manual_seed(0)
    network = CorrectorProbabilities(CorrectorNetwork(0.125)).eval()
    images = torch.randint(0, 256, (3, SIZE, SIZE, 3), dtype=torch.uint8)
    with torch.no_grad():
        together = network(images)
        alone = [network(images[k : k + 1]) for k in range(3)]
    for k, part in enumerate(together):
        torch.testing.assert_close(part, torch.cat([one[k] for one in alone]), atol=1e-5, rtol=1e-4)


def test_a_crop_turned_by_half_a_turn_has_its_line_on_the_other_side():
    torch.manual_seed(0)
    network = CorrectorProbabilities(CorrectorNetwork(0.125)).eval()
    images = torch.randint(0, 256, (3, SIZE, SIZE, 3), dtype=torch.uint8)
    with torch.no_grad():
        straight, turned = network(images), network(images.flip(1, 2))
    for one, other in zip(straight, turned, strict=True):
        torch.testing.assert_close(one, other.flip(1), atol=1e-6, rtol=1e-4)
