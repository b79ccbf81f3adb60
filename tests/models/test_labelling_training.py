"""The corrector's training data and network: truth of crops, mirrored truth, exported equals eager."""

from __future__ import annotations

import numpy as np
import torch

from models.inference import load
from models.labelling.crops import MIDDLE, SIZE
from models.labelling.network_corrector import CorrectorNetwork, CorrectorProbabilities
from models.labelling.train_corrector import NAME, TrainConfig, augment, corrector_loss, train
from models.labelling.train_crops import CropParams, contrast, crops_of, read, write
from models.synthesis.scenes import render_scene
from models.synthesis.textures import load_pool

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
    flat = made._replace(images=np.full_like(made.images, 90))
    assert contrast(flat).max() == 0
    barred = flat.images.copy()
    for k, (column, width) in enumerate(zip(made.columns, made.widths, strict=True)):
        barred[k, :, max(round(column - width / 2), 0) : round(column + width / 2) + 1] = 190
    assert np.median(contrast(made._replace(images=barred))) > 80


def test_writing_goes_on_where_it_was_cut_off(tmp_path):
    write(tmp_path, PARAMS, load_pool(None))
    (file,) = tmp_path.glob("*.npz")
    before = file.stat().st_mtime_ns
    write(tmp_path, PARAMS, load_pool(None))
    assert file.stat().st_mtime_ns == before
    assert len(read(tmp_path).images) > 6


def test_augmented_crops_keep_their_truth():
    """A bright column is where the moved truth says."""
    images = np.zeros((40, SIZE, SIZE, 3), np.uint8)
    columns = np.random.default_rng(0).integers(10, 86, 40).astype(np.float32)
    for image, column in zip(images, columns, strict=True):
        image[:, int(column)] = 255
    moved, at = augment(images, columns, np.random.default_rng(1))
    assert not torch.equal(at, torch.from_numpy(columns))
    assert torch.equal(moved.mean((1, 3)).argmax(1).float(), at)


def test_training_goes_on_and_learns(tmp_path):
    """A few steps on a few crops lower the loss; a state is taken up."""
    made = crops()
    many = type(made)(*(np.concatenate([part] * 4) for part in made))
    config = TrainConfig(epochs=2, batch=8, width=0.125)
    torch.set_num_threads(1)
    network = train(config, many._replace(margins=np.ones(len(many.images))), many, tmp_path / "state.pt")
    fresh = CorrectorNetwork(0.125).eval()
    images = torch.from_numpy(many.images).float()
    truth = torch.from_numpy(many.columns), torch.from_numpy(many.widths)
    with torch.no_grad():
        losses = [float(corrector_loss(*n(images), *truth, config)) for n in (network, fresh)]
    assert losses[0] < losses[1]
    again = train(config, many, many, tmp_path / "state.pt")
    assert all(torch.equal(a, b) for a, b in zip(network.parameters(), again.parameters(), strict=True))


def test_exported_outputs_are_probabilities_and_widths():
    network = load(NAME)
    for count in (1, 5):
        columns, widths = network.run(np.random.default_rng(count).integers(0, 256, (count, SIZE, SIZE, 3), np.uint8))
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
