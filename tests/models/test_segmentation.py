"""Letterboxing to the pixel, the loss, the network's shapes, and training that can be resumed."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import onnx
import onnxruntime
import pytest
import torch

from models.segmentation.segment import ForegroundInput, foreground_mask, network_scale, segment
from models.synthesis.scenes import SceneParams
from models.synthesis.textures import TexturePool, load_pool
from models.training import export
from models.training.foreground.export import main as export_command
from models.training.foreground.initial import unfold
from models.training.foreground.int8 import SINGLE, calibrating, compare, quantize
from models.training.foreground.learning import Learning, foreground_loss
from models.training.foreground.network_compact import CompactNetwork
from models.training.foreground.networks import build
from models.training.foreground.real_pictures import load_labelled
from models.training.foreground.validation import validate
from models.training.state import Config
from models.weights.inference import WEIGHTS, load, manifest

SETTINGS = ForegroundInput(64, 32, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 0.5, 0.8, 4.0)


def red_is_cable(planes: np.ndarray) -> np.ndarray:
    """A network that answers +8 where the red channel is bright, else -8."""
    assert planes.shape[2] % 32 == 0
    assert planes.shape[3] % 32 == 0
    return np.where(planes[:, :1] > 0.5, 8.0, -8.0).astype(np.float32)


@pytest.mark.parametrize(
    "size", [(1, 1), (20, 8000), (31, 33), (64, 64), (33, 50), (360, 640), (641, 127)]
)
def test_any_size_comes_back_at_its_own_size(size):
    probability = segment(np.zeros((*size, 3), np.uint8), red_is_cable, SETTINGS)
    assert probability.shape == size
    assert probability.dtype == np.float32
    assert probability.max() < 0.01


def test_a_picture_that_fits_is_not_moved_by_a_pixel():
    image = np.zeros((40, 50, 3), np.uint8)
    image[10:14, 20:33, 0] = 255
    found = segment(image, red_is_cable, SETTINGS) > 0.5
    assert np.array_equal(found, image[:, :, 0] > 0)


def test_a_reduced_picture_comes_back_where_it_was():
    """Four times too large: a bright square keeps its center to a fraction of a pixel."""
    image = np.zeros((256, 256, 3), np.uint8)
    image[96:160, 32:96, 0] = 255
    found = segment(image, red_is_cable, SETTINGS) > 0.5
    rows, columns = np.nonzero(found)
    assert rows.mean() == pytest.approx(127.5, abs=0.3)
    assert columns.mean() == pytest.approx(63.5, abs=0.3)
    assert found.sum() == pytest.approx(64 * 64, rel=0.05)


@pytest.mark.parametrize(
    ("size", "seen"),
    [
        ((20, 1500), (32, 1504)),
        ((40, 4000), (32, 2048)),
        ((200, 400), (32, 64)),
        ((5, 5), (32, 32)),
    ],
)
def test_a_strip_is_not_reduced_to_nothing(size, seen):
    shapes = []

    def spy(planes):
        shapes.append(planes.shape[2:])
        return red_is_cable(planes)

    segment(np.zeros((*size, 3), np.uint8), spy, SETTINGS)
    assert shapes == [seen]


def test_normalization_is_that_of_training():
    settings = ForegroundInput(64, 32, (0.5, 0.25, 0.0), (0.5, 0.25, 1.0), 0.5, 0.8, 4.0)
    seen = {}

    def spy(planes):
        seen["planes"] = planes
        return np.zeros((1, 1, *planes.shape[2:]), np.float32)

    segment(np.full((32, 32, 3), 255, np.uint8), spy, settings)
    assert seen["planes"][0, :, 0, 0].tolist() == pytest.approx([1.0, 3.0, 1.0])


def test_a_patch_without_certainty_is_left_out_unless_a_threshold_is_asked_for():
    probability = np.zeros((8, 20), np.float32)
    probability[2, 1:9] = 0.95
    probability[3, 1:9] = 0.6  # the faint edge of a certain cable stays with it
    probability[1, 1:9] = 0.95
    probability[2, 12:18] = 0.7
    probability[6, 2:5] = 1.0  # certain, but three pixels are no cable
    kept = foreground_mask(probability, SETTINGS)
    assert kept[1:4, 1:9].all()
    assert kept.sum() == 24
    literal = foreground_mask(probability, SETTINGS, threshold=0.65)
    assert literal[2, 12:18].all()
    assert literal.sum() == 25
    assert not foreground_mask(np.zeros((2, 2), np.float32), SETTINGS, threshold=0.0).any()


def test_network_answers_at_the_size_of_its_input():
    network = CompactNetwork().eval()
    with torch.no_grad():
        assert network(torch.zeros(2, 3, 64, 96)).shape == (2, 1, 64, 96)
    assert sum(p.numel() for p in network.parameters()) < 5_000_000


def test_batched_equals_one_by_one():
    network = CompactNetwork().eval()
    x = torch.rand(3, 3, 32, 64, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        together, apart = network(x), torch.cat([network(x[k : k + 1]) for k in range(3)])
    assert torch.allclose(together, apart, atol=1e-5)


def test_loss_prefers_the_truth():
    labels = torch.zeros(2, 8, 8, dtype=torch.uint8)
    labels[0, 2:4] = 255
    right = torch.where(labels == 255, 9.0, -9.0).unsqueeze(1)
    assert float(foreground_loss(right, labels)) < 0.01
    assert float(foreground_loss(-right, labels)) > 5


@pytest.mark.slow
def test_training_learns_and_resumes_where_it_was(tmp_path):
    config = Config(minutes=1.0, batch=2, keep=0.99)
    learning = Learning("compact", 1, config)
    image = torch.zeros(2, 3, 32, 32, dtype=torch.uint8)
    image[:, 0, 10:20] = 255
    learning.network.train()
    losses = [learning.step(image, image[:, 0]) for _ in range(12)]
    assert losses[-1] < losses[0]
    learning.course.seconds = 30.0
    learning.save(tmp_path / "last.pt", {})

    resumed = Learning("compact", 1, config)
    assert resumed.resume(tmp_path / "last.pt")
    assert (resumed.course.steps, resumed.course.seconds) == (12, 30.0)
    for a, b in zip(learning.average.parameters(), resumed.average.parameters(), strict=True):
        assert torch.equal(a, b)
    assert not resumed.resume(tmp_path / "none.pt")


@pytest.mark.parametrize("metrics", [{}, {"dice": 0.0, "false": 0.0}])
def test_a_network_that_finds_nothing_is_not_exported(metrics, tmp_path, capsys, monkeypatch):
    """One with Dice 0.0 took the place of the shipped one without a word."""
    monkeypatch.setattr(export, "WEIGHTS", tmp_path / "weights")
    Learning("compact", 1, Config()).save(tmp_path / "last.pt", {}, metrics=metrics)
    with pytest.raises(SystemExit):
        export_command([str(tmp_path / "last.pt")])
    assert "foreground_compact is not exported: rendered_dice is" in capsys.readouterr().err
    assert not (tmp_path / "weights").exists()


def test_validation_reports_and_draws(tmp_path):
    scenes = SceneParams(size=(32, 64), empty_share=0.4)
    metrics = validate(
        CompactNetwork().eval(), tmp_path / "sheet.png", TexturePool(()), scenes, count=12
    )
    assert set(metrics) == {"dice", "false"}
    assert 0 <= metrics["dice"] <= 1
    assert (tmp_path / "sheet.png").exists()


def test_an_exported_network_can_be_trained_further():
    """Batch normalizations are folded away in the file: unfolded, the function is the same, in
    training mode with the statistics of the same pictures too."""
    network = CompactNetwork()
    file = WEIGHTS / "foreground_compact.onnx"
    pictures = torch.randn(1, 3, 64, 96, generator=torch.Generator().manual_seed(0))
    assert unfold(file, network, [pictures]) == 63
    exported = load("foreground_compact")(pictures.numpy())
    with torch.no_grad():
        assert np.abs(network.eval()(pictures).numpy() - exported).max() < 2e-3
        assert np.abs(network.train()(pictures).numpy() - exported).max() < 0.1
    with pytest.raises(ValueError, match="lateral"):
        unfold(file, CompactNetwork(24), [pictures])


@pytest.mark.parametrize("name", ["foreground_deeplab_convnext_t", "foreground_deeplab_resnet50"])
def test_so_can_one_whose_normalizations_are_not_in_a_row(name):
    """A ResNet's are ``bn1`` beside ``conv1``, the linear layers of the others lose their names in
    the file: a training could not go on once its checkpoint was gone."""
    training = manifest()[name].training
    network = build(training["network"], training["slim"])
    pictures = torch.randn(2, 3, 64, 96, generator=torch.Generator().manual_seed(0))
    unfold(WEIGHTS / manifest()[name].file, network, [pictures])
    exported = np.concatenate([load(name)(one.numpy()[None]) for one in pictures])
    with torch.no_grad():
        assert np.abs(network.eval()(pictures).numpy() - exported).max() < 2e-3
    with pytest.raises(ValueError, match="the file has no"):
        unfold(WEIGHTS / "foreground_compact.onnx", network)


def test_a_swin_goes_on_from_its_checkpoint_alone():
    """The exporter turns its tables of relative positions into what they stand for."""
    training = manifest()["foreground_deeplab_swin_t"].training
    with pytest.raises(ValueError, match=r"the file has no .*relative_position_bias_table"):
        unfold(
            WEIGHTS / "foreground_deeplab_swin_t.onnx", build(training["network"], training["slim"])
        )


@pytest.mark.slow
def test_the_eight_bit_network_sees_what_the_full_one_sees():
    settings = ForegroundInput.from_manifest(manifest()["foreground_compact"].preprocess)
    full, small = load("foreground_compact"), load("foreground_compact_int8")
    assert small.spec.bytes < 0.4 * full.spec.bytes
    assert small.spec.preprocess == full.spec.preprocess
    assert compare(full, small, load_pool(None), 6)["differing_pixels"] < 0.03
    for size in ((32, 32), (224, 320)):
        assert small(np.zeros((1, 3, *size), np.float32)).shape == (1, 1, *size)
    assert (settings.long_side, settings.most_enlarged) == (960, 2.0)


@pytest.mark.slow
def test_every_convolution_but_the_first_is_quantized(tmp_path):
    """With all of them in 8 bits, photographs lost .7 Dice."""
    spec = manifest()["foreground_compact"]
    settings = replace(ForegroundInput.from_manifest(spec.preprocess), long_side=128)
    quantize(
        WEIGHTS / spec.file,
        tmp_path / "small.onnx",
        settings,
        calibrating(load_pool(None), 2, None),
    )
    graph = onnx.load(tmp_path / "small.onnx").graph
    quantized = {o for n in graph.node if n.op_type == "DequantizeLinear" for o in n.output}
    fed = [[i in quantized for i in n.input[:2]] for n in graph.node if n.op_type == "Conv"]
    assert fed == [[False, False]] * SINGLE + [[True, True]] * (len(fed) - SINGLE)
    session = onnxruntime.InferenceSession(
        tmp_path / "small.onnx", providers=["CPUExecutionProvider"]
    )
    assert session.run(None, {"input": np.zeros((1, 3, 64, 64), np.float32)})[0].shape == (
        1,
        1,
        64,
        64,
    )


def test_photographs_of_the_training_set_join_those_that_set_the_ranges(tmp_path):
    for part in ("imgs", "masks"):
        (tmp_path / part).mkdir()
    for k in range(3):
        levels = np.full((40, 60, 3), 200 + k, np.uint8)
        cv2.imwrite(str(tmp_path / "imgs" / f"p{k}.jpg"), levels)
        cv2.imwrite(str(tmp_path / "masks" / f"p{k}.png"), np.zeros((40, 60), np.uint8))
    trained = len(load_labelled(tmp_path).photographs)
    pictures = list(calibrating(load_pool(None), 2, tmp_path))
    assert len(pictures) == 2 + min(trained, 2)
    assert sum(p.shape == (40, 60, 3) for p in pictures) == min(trained, 2) > 0


def test_a_small_picture_is_enlarged_as_far_as_the_network_wants():
    settings = replace(SETTINGS, long_side=960, most_enlarged=1.5)
    assert [
        network_scale(size, settings) for size in ((360, 640), (100, 160), (540, 960), (1080, 1920))
    ] == [
        1.5,
        1.5,
        1.0,
        0.5,
    ]
    assert network_scale((100, 160), replace(settings, most_enlarged=1.0)) == 1.0
