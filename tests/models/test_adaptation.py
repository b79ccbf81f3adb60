"""Adapting a network: what is learnt from, what is kept of it, and what is refused."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import onnxruntime
import pytest
import torch

from models.segmentation.segment import ForegroundInput
from models.training.foreground.adaptation.choice import Exam, Scores, best, dice, refusal
from models.training.foreground.adaptation.course import CourseParams, begun, step
from models.training.foreground.adaptation.sources import Batches, general_set, read_own, rehearsal
from models.training.foreground.initial import refold, unfold
from models.training.foreground.networks import build
from models.weights.inference import WEIGHTS, manifest

pytestmark = pytest.mark.no_cover  # of training: nothing there is measured
PARENT = WEIGHTS / "foreground_compact.onnx"
FED = ForegroundInput.from_manifest(manifest()["foreground_compact"].preprocess)


def answer(file: bytes, x: torch.Tensor) -> np.ndarray:
    session = onnxruntime.InferenceSession(file)
    (found,) = session.run(None, {session.get_inputs()[0].name: x.numpy()})
    return found


@torch.no_grad()
def test_a_network_goes_back_into_its_file_with_all_that_it_has_learnt() -> None:
    network = build("compact").eval()
    unfold(PARENT, network)
    x = torch.randn(1, 3, 64, 96, generator=torch.Generator().manual_seed(1))
    for p in network.parameters():
        p.mul_(1.03)
    for norm in (m for m in network.modules() if isinstance(m, torch.nn.BatchNorm2d)):
        norm.running_mean.add_(0.01)
    np.testing.assert_allclose(answer(refold(PARENT, network), x), network(x).numpy(), atol=2e-3)
    np.testing.assert_allclose(
        answer(refold(PARENT, network, 0.0), x), answer(PARENT.read_bytes(), x), atol=1e-6
    )
    before, after, between = (
        answer(PARENT.read_bytes(), x),
        network(x).numpy(),
        answer(refold(PARENT, network, 0.5), x),
    )
    apart = np.abs(after - before).mean()
    assert np.abs(between - before).mean() < apart
    assert np.abs(between - after).mean() < apart


def test_a_file_of_another_network_is_refused() -> None:
    with pytest.raises(ValueError, match=r"features\.0\.0"):
        refold(PARENT, build("dense", slim=8))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for part in ("imgs", "masks"):
        (tmp_path / part).mkdir()
    for k in range(10):
        image, mask = np.full((96, 160, 3), 40, np.uint8), np.zeros((96, 160), np.uint8)
        image[20 + k : 30 + k], mask[20 + k : 30 + k] = 220, 255
        cv2.imwrite(str(tmp_path / "imgs" / f"{k}.png"), image)
        cv2.imwrite(str(tmp_path / "masks" / f"{k}.png"), mask)
    return tmp_path


def test_what_is_kept_aside_depends_on_the_names_alone_and_never_trains(folder: Path) -> None:
    own = read_own(folder, 0.2)
    assert (len(own.trains), len(own.aside)) == (8, 2)
    assert not {p.name for p in own.trains} & {p.name for p in own.aside}
    assert [p.name for p in read_own(folder, 0.2).aside] == [p.name for p in own.aside]
    assert len(read_own(folder, 0.01).aside) == 1
    assert len(read_own(folder, 0.9).trains) == 2


def test_pictures_without_a_cable_are_nothing_to_learn_from(folder: Path) -> None:
    for file in (folder / "masks").iterdir():
        cv2.imwrite(str(file), np.zeros((96, 160), np.uint8))
    with pytest.raises(ValueError, match="shows a cable"):
        read_own(folder, 0.2)


def test_a_batch_mixes_the_places_own_pictures_with_renders(folder: Path) -> None:
    own, renders = read_own(folder, 0.2), rehearsal((64, 96), 2)
    for share, bright in ((1.0, 1.0), (0.0, 0.0)):
        batches = Batches(own, renders, share, FED, np.random.default_rng(0))
        images, labels = batches.draw(12)
        assert images.shape == (12, 3, 64, 96)
        assert labels.shape == (12, 64, 96)
        # A bar of one tone over another: few levels, which no render has.
        few = np.mean(
            [len(np.unique(cut.numpy() // 24)) <= 14 and (cut.float().std() > 5) for cut in images]
        )
        assert few >= bright * 0.5


def test_the_general_set_is_always_the_same() -> None:
    (first, mask), (again, _) = general_set(1, (64, 96))[0], general_set(1, (64, 96))[0]
    assert np.array_equal(first, again)
    assert mask.any()


def test_dice_of_pictures_without_cables_falls_with_false_pixels() -> None:
    true = np.zeros((100, 100), bool)
    found = true.copy()
    assert dice(found, true) == 100
    found[:1, :10] = True
    few = dice(found, true)
    found[:10] = True
    assert 100 > few > dice(found, true)


def test_pixels_where_nobody_can_tell_do_not_count() -> None:
    true, found, known = np.zeros((9, 9), bool), np.ones((9, 9), bool), np.zeros((9, 9), bool)
    true[0] = known[0] = True
    assert dice(found, true, known) == 100


def test_the_mixture_gains_most_for_what_it_forgets() -> None:
    before = Scores((70.0,), (85.0,))
    mixtures = {
        1.0: Scores((80.0,), (80.0,)),
        0.65: Scores((79.0,), (84.5,)),
        0.5: Scores((76.0,), (85.2,)),
    }
    assert best(before, mixtures) == 0.65
    assert best(before, {1.0: before, 0.5: before}) == 0.5
    # The best of all would be refused: a smaller share is to be had.
    assert best(before, {0.5: Scores((80.0,), (83.8,)), 0.2: Scores((73.0,), (84.4,))}) == 0.2


@pytest.mark.parametrize(
    ("after", "why"),
    [
        (Scores((70.0,), (85.0, 60.0)), None),
        (Scores((90.0,), (83.1, 60.0)), None),
        (Scores((69.9,), (85.0, 60.0)), "falls from 70.0 to 69.9"),
        (
            Scores((90.0,), (82.8, 60.0)),
            "it forgets: where Dice on the general set falls, it costs 1.1",
        ),
        # gains on hard renders hid that edges moved on easy ones
        (Scores((90.0,), (82.8, 80.0)), "it costs 1.1"),
    ],
)
def test_a_network_that_is_worse_or_forgets_is_refused(after: Scores, why: str | None) -> None:
    refused = refusal(Scores((70.0,), (85.0, 60.0)), after)
    assert (refused is None) if why is None else (why in str(refused))


def test_an_exam_measures_every_picture(folder: Path) -> None:
    own = read_own(folder, 0.2)
    exam = Exam(own.aside, [(own.aside[0].rgb, own.aside[0].labels > 0)], 0.5)
    scores = exam.scores(lambda rgb: (rgb[:, :, 0] > 128).astype(np.float32))
    assert scores == Scores((100.0, 100.0), (100.0,))


@pytest.mark.slow
def test_a_course_goes_on_from_its_checkpoint_and_leaves_the_first_stages_alone(
    folder: Path, tmp_path: Path
) -> None:
    params = CourseParams(batch=2, height=64, width=96, minutes=0.5)
    batches = Batches(
        read_own(folder, 0.2), rehearsal((64, 96), 2), 0.5, FED, np.random.default_rng(0)
    )
    course = begun("compact", PARENT, params)
    first = {k: v.clone() for k, v in course.network.state_dict().items()}
    step(course, batches)
    step(course, batches)
    course.save(tmp_path / "c.pt")
    after = course.network.state_dict()
    assert torch.equal(after["features.1.conv.0.weight"], first["features.1.conv.0.weight"])
    assert not torch.equal(after["features.9.conv.0.weight"], first["features.9.conv.0.weight"])
    assert torch.equal(
        after["features.9.conv.1.running_mean"], first["features.9.conv.1.running_mean"]
    )
    again = begun("compact", PARENT, params)
    again.restore(tmp_path / "c.pt")
    assert (again.steps, again.seconds) == (2, course.seconds)
    assert torch.equal(
        again.average.state_dict()["head.0.weight"], course.average.state_dict()["head.0.weight"]
    )
