"""Training on renders and real photographs together: cuts, labels, the mixture and a short run."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from models.synthesis.scenes import SceneParams, render_scene
from models.synthesis.textures import TexturePool
from models.training.foreground.augmentation import UNKNOWN, Cut, cut_out, recolored
from models.training.foreground.campaign import CampaignParams, main
from models.training.foreground.learning import foreground_loss
from models.training.foreground.real_pictures import kept_aside, load_labelled
from models.training.foreground.teacher import Teacher, taught_loss

pytestmark = pytest.mark.no_cover  # of training and synthesis: nothing there is measured


def photographs(folder: Path, names: list[str]) -> None:
    """A labelled picture each: a bright bar, a stripe beside it that nobody could tell."""
    (folder / "imgs").mkdir(parents=True)
    (folder / "masks").mkdir()
    for k, name in enumerate(names):
        image = np.full((120, 160, 3), 40 + k, np.uint8)
        labels = np.zeros((120, 160), np.uint8)
        image[50:60], labels[50:60] = 220, 255
        labels[60:66] = UNKNOWN
        cv2.imwrite(str(folder / "imgs" / f"{name}.jpg"), image)
        cv2.imwrite(str(folder / "masks" / f"{name}.png"), labels)


def names(place: str, count: int) -> list[str]:
    return [name for name in (f"{place}_{k:03d}" for k in range(100)) if not kept_aside(name)][
        :count
    ]


def test_a_cut_moves_picture_and_labels_alike() -> None:
    image = np.zeros((200, 300, 3), np.uint8)
    labels = np.zeros((200, 300), np.uint8)
    image[90:110, :] = 255
    labels[90:110, :] = 255
    for seed in range(20):
        rng = np.random.default_rng(seed)
        picture, found = cut_out(image, labels, Cut((64, 96), (0.4, 2.0), 0.5), rng)
        assert picture.shape == (64, 96, 3)
        inside = cv2.erode((found == 255).astype(np.uint8), np.ones((5, 5))) > 0
        outside = cv2.dilate((found == 255).astype(np.uint8), np.ones((5, 5))) == 0
        assert (picture[inside, 0] > 127).all()
        assert (picture[outside, 0] < 127).all()


def test_what_nobody_could_tell_stays_unknown_at_every_scale() -> None:
    labels = np.zeros((200, 300), np.uint8)
    labels[80:120] = UNKNOWN
    for scale in (0.3, 1.0, 1.7):
        cut = Cut((60, 80), (scale, scale), 0.0)
        _, found = cut_out(
            np.zeros((200, 300, 3), np.uint8),
            labels,
            cut,
            np.random.default_rng(1),
            np.array([150.0, 100]),
        )
        assert set(np.unique(found)) <= {0, UNKNOWN}
        assert (found == UNKNOWN).any()


def test_recolored_pictures_keep_their_shape_and_type() -> None:
    image = np.random.default_rng(0).integers(0, 255, (40, 60, 3)).astype(np.uint8)
    for seed in range(30):
        out = recolored(image, np.random.default_rng(seed))
        assert out.shape == image.shape
        assert out.dtype == np.uint8


def test_a_place_with_many_pictures_does_not_drown_the_others(tmp_path: Path) -> None:
    photographs(tmp_path, names("table", 40) + names("bench", 2))
    real = load_labelled(tmp_path)
    bench = sum(
        c for p, c in zip(real.photographs, real.chances, strict=True) if p.name.startswith("bench")
    )
    assert bench == pytest.approx(1 / 3.5)


def test_pictures_kept_aside_never_train(tmp_path: Path) -> None:
    photographs(tmp_path, [f"a_{k:03d}" for k in range(40)])
    trains = {p.name for p in load_labelled(tmp_path).photographs}
    aside = {p.name for p in load_labelled(tmp_path, aside=True).photographs}
    assert trains | aside == {f"a_{k:03d}" for k in range(40)}
    assert not trains & aside
    assert aside


def test_a_mask_of_another_size_is_refused_by_name(tmp_path: Path) -> None:
    name = names("a", 1)[0]
    photographs(tmp_path, [name])
    cv2.imwrite(str(tmp_path / "masks" / f"{name}.png"), np.zeros((10, 10), np.uint8))
    with pytest.raises(ValueError, match=name):
        load_labelled(tmp_path)


def test_unknown_pixels_have_no_weight() -> None:
    labels = torch.zeros(1, 8, 8, dtype=torch.uint8)
    labels[:, :4] = 255
    logits = torch.where(labels == 255, 9.0, -9.0).unsqueeze(1)
    doubtful = labels.clone()
    doubtful[:, 6:] = UNKNOWN
    wrong = logits.clone()
    wrong[:, :, 6:] = 9.0
    assert foreground_loss(wrong, doubtful) == pytest.approx(
        float(foreground_loss(logits, labels)), abs=0.01
    )
    assert foreground_loss(wrong, labels) > 1.0


def test_a_teacher_counts_where_nobody_could_tell_and_it_is_sure() -> None:
    labels = torch.full((1, 8, 8), UNKNOWN, dtype=torch.uint8)
    logits = torch.full((1, 1, 8, 8), -9.0)
    sure, unsure = torch.full((1, 8, 8), 0.99), torch.full((1, 8, 8), 0.7)
    assert float(taught_loss(logits, labels, sure)) > 8
    assert float(taught_loss(logits, labels, unsure)) == 0
    labels[:] = 255
    assert float(taught_loss(logits, labels, unsure)) > 6


def test_what_a_teacher_sees_mirrored_and_resized_is_put_back_in_its_place() -> None:
    image = np.zeros((40, 60, 3), np.uint8)
    image[10:20, 5:20] = 255
    looked: list[tuple[int, float]] = []

    def look(picture: np.ndarray, scale: float) -> np.ndarray:
        looked.append((int(picture[15, 10, 0]), scale))
        size = round(60 * scale), round(40 * scale)
        return cv2.resize(
            picture[:, :, 0].astype(np.float32) / 255, size, interpolation=cv2.INTER_AREA
        )

    teacher = Teacher(look, np.random.default_rng(2))
    pictures = torch.from_numpy(image).permute(2, 0, 1).expand(12, 3, 40, 60)
    for seen in teacher(pictures):
        assert seen[12:18, 7:18].min() > 0.9
        assert seen[:, 25:].max() < 0.1
    assert {value for value, _ in looked} == {0, 255}
    assert len({scale for _, scale in looked}) == 3


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"slots": 3}, "slots is 3"),
        ({"slots": 9, "renderers": 4}, "it takes 10"),
        ({"batch": 0}, "batch"),
        ({"minutes": 0.0}, "minutes"),
        ({"labelled": -1.0}, "labelled"),
    ],
)
def test_a_training_that_would_wait_for_ever_is_refused(
    settings: dict[str, float], named: str
) -> None:
    """With too few slots the first step never came: a renderer rests when the slots are full."""
    with pytest.raises(ValueError, match=named):
        CampaignParams(**settings)  # type: ignore[arg-type]


@pytest.mark.slow
def test_renders_alone_train_too_with_a_teacher(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = [
        "campaign",
        str(tmp_path),
        "--height",
        "64",
        "--width",
        "96",
        "--batch",
        "2",
        "--slots",
        "8",
        "--validate",
        "12",
        "--minutes",
        "0.02",
        "--slim",
        "4",
        "--teacher",
        "foreground_compact",
    ]
    monkeypatch.setattr("sys.argv", command)
    main()
    state = torch.load(tmp_path / "last.pt", weights_only=True)
    assert state["progress"]["steps"] > 0
    assert (state["params"]["network"], state["params"]["slim"]) == ("compact", 4)


@pytest.mark.slow
def test_a_run_is_resumed_where_it_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    photographs(tmp_path / "real", names("a", 2))
    (tmp_path / "empty").mkdir()
    cv2.imwrite(
        str(tmp_path / "empty" / f"{names('b', 1)[0]}.jpg"), np.full((90, 90, 3), 99, np.uint8)
    )
    (tmp_path / "textures" / "group").mkdir(parents=True)
    cv2.imwrite(str(tmp_path / "textures" / "group" / "t.png"), np.full((90, 90, 3), 99, np.uint8))
    command = [
        "campaign",
        str(tmp_path / "out"),
        "--textures",
        str(tmp_path / "textures"),
        "--labelled",
        str(tmp_path / "real"),
        "--empty-pictures",
        str(tmp_path / "empty"),
        "--height",
        "64",
        "--width",
        "96",
        "--batch",
        "2",
        "--slots",
        "8",
        "--validate",
        "12",
        "--minutes",
    ]
    for minutes in ("0.02", "0.05"):
        monkeypatch.setattr("sys.argv", [*command, minutes])
        main()
    lines = [json.loads(line) for line in (tmp_path / "out" / "log.jsonl").read_text().splitlines()]
    assert lines[1]["step"] > lines[0]["step"] > 0
    assert lines[1]["pictures"] == 2 * lines[1]["step"]
    state = torch.load(tmp_path / "out" / "last.pt", weights_only=True)
    assert state["params"]["network"] == "compact"
    assert 0 <= state["metrics"]["dice"] <= 1


@pytest.mark.slow
@pytest.mark.parametrize("share", ["air_share", "fan_share", "ribbon_share", "alike_share"])
def test_every_new_kind_of_scene_is_drawn_and_labelled(share: str) -> None:
    params = SceneParams((96, 160), style="workshop", empty_share=0.0, **{share: 1.0})
    for seed in range(6):
        scene = render_scene(np.random.default_rng(seed), params, TexturePool(()))
        assert torch.isfinite(scene.rgb).all()
        assert scene.ids.max() <= len(scene.centerlines)
        assert scene.ids.max() > 0 or seed


def test_scenes_without_the_new_kinds_are_those_of_before() -> None:
    """Shares of 0 draw nothing from the generator: seeds of earlier trainings give their
    pictures."""
    state = np.random.default_rng(7)
    render_scene(state, SceneParams((64, 96)), TexturePool(()))
    again = np.random.default_rng(7)
    render_scene(again, SceneParams((64, 96), air_share=0.0, fan_share=0.0), TexturePool(()))
    assert state.bit_generator.state == again.bit_generator.state
