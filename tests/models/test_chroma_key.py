"""The chroma key: recordings made with the renderer, whose truth is known; bad input; stopping and
going on."""

from __future__ import annotations

import errno
import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from models.synthesis import chroma_key, datasets
from models.synthesis.chroma_key import key
from models.synthesis.chroma_ranges import ScreenError, find_ranges, foreground, to_hsv
from models.synthesis.chroma_screen import random_screen, render_before_screen
from models.synthesis.chroma_source import SourceError, frames, spread
from models.synthesis.chroma_swap import blend, open_backgrounds, vary_background, vary_foreground
from models.synthesis.datasets import DatasetError, load, samples_in

pytestmark = pytest.mark.slow

SIZE = (120, 200)


def recording(
    hue: float, count: int, own_hue: bool = False, size: tuple[int, int] = SIZE
) -> list[tuple[np.ndarray, np.ndarray]]:
    screen = random_screen(np.random.default_rng(5), hue, size)
    shots = [
        render_before_screen(np.random.default_rng([5, k]), screen, own_hue) for k in range(count)
    ]
    return [(rgb, ids > 0) for rgb, ids in shots]


def save(picture: np.ndarray, file: Path) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(file), picture[:, :, ::-1])


def iou(found: np.ndarray, true: np.ndarray) -> float:
    return np.count_nonzero(found & true) / max(np.count_nonzero(found | true), 1)


@pytest.fixture
def folders(tmp_path):
    """Three recorded pictures and a background."""
    for k, (rgb, _) in enumerate(recording(120.0, 3)):
        save(rgb, tmp_path / "recorded" / f"{k}.png")
    save(np.full((90, 90, 3), (200, 30, 30), np.uint8), tmp_path / "backgrounds" / "red.png")
    return tmp_path


def run(folders: Path, out: str = "out", source: str = "recorded", *more: str) -> int:
    backgrounds = ("--backgrounds", str(folders / "backgrounds"))
    return chroma_key.main(
        [str(folders / source), str(folders / out), *backgrounds, "--per-image", "2", *more]
    )


# What it finds


@pytest.mark.parametrize("hue", [120.0, 220.0])
def test_the_key_agrees_with_the_truth(hue):
    """Uneven light, wrinkles, shadows and noise; the contour at half coverage, not a pixel
    outside."""
    shots = recording(hue, 6)
    ranges = find_ranges([rgb for rgb, _ in shots])
    assert ranges.hue_deg[0] < hue < ranges.hue_deg[1]
    assert ranges.hue_deg[1] - ranges.hue_deg[0] < 30
    scores = [iou(key(rgb, ranges).mask, true) for rgb, true in shots]
    assert np.mean(scores) > 0.9
    assert (
        np.mean(scores)
        > np.mean([iou(foreground(to_hsv(rgb), ranges), true) for rgb, true in shots]) + 0.05
    )


def test_the_contour_carries_no_color_of_the_screen():
    picture = np.full((60, 60, 3), (20, 180, 20), np.uint8)
    cv2.line(picture, (0, 10), (60, 45), (200, 20, 20), 9, cv2.LINE_AA)
    keyed = key(picture, find_ranges([picture]))
    red, green = (
        keyed.clean[keyed.mask][:, 0].astype(int),
        keyed.clean[keyed.mask][:, 1].astype(int),
    )
    assert (red > green).all()


def test_a_dlo_of_the_screens_hue_is_noticed():
    """Where its saturation is another one; a DLO of the very color of the screen cannot be told
    from it."""
    size = (360, 640)
    ranges = find_ranges([rgb for rgb, _ in recording(120.0, 8, size=size)])
    assert not any(key(rgb, ranges).screen_hue for rgb, _ in recording(120.0, 8, size=size))
    other = []
    for rgb, true in recording(120.0, 8, own_hue=True, size=size):
        saturation = to_hsv(rgb)[..., 1]
        if abs(np.median(saturation[true]) - np.median(saturation[~true])) > 0.2:
            other.append(key(rgb, ranges).screen_hue)
    assert len(other) >= 3
    assert np.mean(other) > 0.6


def glossy(cable: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """A green mat in which a lamp is mirrored, and a cable of this color across it: picture and
    true mask."""
    y, x = np.mgrid[:240, :400].astype(np.float32)
    lamp = np.exp(-(((x - 200) / 70) ** 2) - ((y - 120) / 35) ** 2)[..., None]
    mat = np.array([40, 110, 60], np.float32) * (0.8 + 0.3 * x[..., None] / 400)
    rng = np.random.default_rng(3)
    picture = (
        mat
        + (np.array([235, 240, 225]) - mat) * np.clip(1.3 * lamp, 0, 1)
        + rng.normal(0, 2, (240, 400, 1))
    )
    mask = np.zeros((240, 400), np.uint8)
    cv2.line(mask, (0, 60), (399, 190), 1, 11)
    picture[mask > 0] = cable
    return cv2.GaussianBlur(np.clip(picture, 0, 255), (0, 0), 0.7).astype(np.uint8), mask > 0


@pytest.mark.parametrize("cable", [(200, 30, 30), (20, 60, 170), (30, 30, 30)])
def test_a_lamp_mirrored_in_a_glossy_mat_is_no_dlo(cable):
    picture, true = glossy(cable)
    keyed = key(picture, find_ranges([picture]))
    assert iou(keyed.mask, true) > 0.8
    assert not keyed.screen_hue


def test_a_white_dlo_outside_the_highlight_stays():
    picture, _ = glossy((200, 30, 30))
    white = np.zeros((240, 400), np.uint8)
    cv2.line(white, (20, 225), (390, 215), 1, 9)
    picture[white > 0] = (240, 240, 240)
    mask = key(picture, find_ranges([picture])).mask
    assert mask[white > 0].mean() > 0.8


def test_ranges_that_are_given_are_used_and_the_others_are_found(folders):
    more = ("--hue", "100", "140", "--value", "0.1", "1")
    assert run(folders, "out", "recorded", *more) == 0
    begun = json.loads((folders / "out" / chroma_key.SETTINGS).read_text())
    found = find_ranges([rgb for rgb, _ in recording(120.0, 3)])
    assert begun["ranges"]["hue_deg"] == [100.0, 140.0]
    assert begun["ranges"]["value"] == [0.1, 1.0]
    assert begun["ranges"]["saturation"] == pytest.approx(found.saturation)
    assert run(folders, "out") == 1  # begun with other settings


@pytest.mark.parametrize("bounds", [("140", "100"), ("-5", "20"), ("10", "400"), ("nan", "20")])
def test_ranges_that_are_none_are_named(folders, bounds, capsys):
    assert run(folders, "out", "recorded", "--hue", *bounds) == 1
    assert "--hue" in capsys.readouterr().err


def test_the_page_holds_the_pictures_and_the_ranges(folders):
    file = folders / "ranges.html"
    assert run(folders, "out", "recorded", "--page", str(file), "--hue", "100", "140") == 0
    text = file.read_text()
    assert text.count("data:image/png;base64,") == 3
    assert '"hue": [100.0, 140.0]' in text
    assert not (folders / "out").exists()


def test_the_warning_names_the_share(folders, capsys):
    for k, (rgb, _) in enumerate(recording(120.0, 6)):
        if k in (1, 4):
            cv2.circle(rgb, (50, 50), 12, (60, 110, 60), -1)
        save(rgb, folders / "green" / f"{k}.png")
    assert run(folders, source="green") == 0
    assert "2 of 6 pictures (33%)" in capsys.readouterr().err


# Equation 2.1 and the augmentation


def test_blend_is_a_weighted_sum_across_the_contour():
    """A straight edge between columns 19 and 20 weighs about half on both sides, all or nothing far
    away."""
    mask = np.zeros((40, 40), bool)
    mask[:, 20:] = True
    out = blend(np.full((40, 40, 3), 200, np.uint8), np.zeros((40, 40, 3), np.uint8), mask, 1.0)
    assert out[20, 0].tolist() == [0, 0, 0]
    assert out[20, 39].tolist() == [200, 200, 200]
    assert out[20, 19, 0] + out[20, 20, 0] == pytest.approx(200, abs=1)
    assert 50 < out[20, 19, 0] < 100


def test_the_foreground_takes_the_screens_hue_too():
    """A red DLO becomes, over many draws, every hue; green among them; grey about once in ten."""
    red = np.full((2, 2, 3), (200, 20, 20), np.uint8)
    drawn = np.stack([vary_foreground(red, np.random.default_rng(k))[0, 0] for k in range(600)])
    hsv = cv2.cvtColor(drawn[None], cv2.COLOR_RGB2HSV)[0]
    colored = hsv[hsv[:, 1] > 0]
    assert (np.histogram(colored[:, 0], 12, (0, 180))[0] > 5).all()
    assert 0.06 < np.mean(hsv[:, 1] == 0) < 0.15


def test_backgrounds_fill_the_picture_whatever_their_size():
    for seed, shape in enumerate([(30, 90, 3), (300, 200, 3), (64, 64, 3)] * 4):
        out = vary_background(np.full(shape, 90, np.uint8), SIZE, np.random.default_rng(seed))
        assert out.shape == (*SIZE, 3)
        assert (out == 90).all()


# The set


def test_the_set_holds_originals_and_swaps_and_can_be_read(folders, capsys):
    report = folders / "report.png"
    assert run(folders, "out", "recorded", "--show", str(report)) == 0
    printed = capsys.readouterr().out
    assert "screen hue (degrees): 1" in printed
    assert "screen saturation" in printed
    samples = samples_in(folders / "out")
    assert len(samples) == 3 * (1 + 2)
    pictures = {s.name: load(s) for s in samples}
    assert np.array_equal(pictures["000001"][0], recording(120.0, 3)[1][0])
    swapped, mask = pictures["000001_0"]
    assert (
        swapped[~cv2.dilate(mask.astype(np.uint8), np.ones((9, 9))).astype(bool)] == (200, 30, 30)
    ).all()
    assert cv2.imread(str(report)).shape[1] == 1280


def test_a_video_gives_what_its_frames_give(folders):
    file = folders / "video.avi"
    shots = [rgb for rgb, _ in recording(120.0, 5)]
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter_fourcc(*"MJPG"), 10, SIZE[::-1])
    for rgb in shots:
        writer.write(np.ascontiguousarray(rgb[:, :, ::-1]))
    writer.release()
    read = dict(frames(file, every=2))
    assert list(read) == [0, 2, 4]
    assert np.abs(read[2].astype(int) - shots[2]).mean() < 12
    kept, total = spread(file, 1, count=2)
    assert total == 5
    assert 2 <= len(kept) <= 4
    assert run(folders, source="video.avi") == 0


def test_a_full_disk_stops_the_run_and_the_next_goes_on(folders, monkeypatch, capsys):
    """What a run in two parts leaves is, byte for byte, what one run leaves."""
    assert run(folders, "whole") == 0
    write, written = Path.write_bytes, []

    def limited(self: Path, content: bytes) -> int:
        if self.name.startswith("0") and len(written) == 7:
            write(self, content[: len(content) // 2])
            raise OSError(errno.ENOSPC, "No space left on device")
        written.append(self)
        return write(self, content)

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", limited)
        assert run(folders) == 1
    assert "the disk is full" in capsys.readouterr().err
    assert not list((folders / "out").glob("*.tmp"))
    assert 0 < len(samples_in(folders / "out")) < 9
    for sample in samples_in(folders / "out"):
        load(sample)
    assert run(folders) == 0
    for file in (folders / "whole").iterdir():
        assert file.read_bytes() == (folders / "out" / file.name).read_bytes()


def test_an_index_line_that_does_not_fit_is_taken_back(tmp_path):
    datasets.append_index(tmp_path, {"name": "a"})
    with (tmp_path / "index.jsonl").open("a") as file:
        file.write('{"name": "b')
    assert [r["name"] for r in datasets.read_index(tmp_path)] == ["a"]
    datasets.append_index(tmp_path, {"name": "c"})
    assert [r["name"] for r in datasets.read_index(tmp_path)] == ["a", "c"]


def test_going_on_with_other_settings_is_refused(folders, capsys):
    assert run(folders) == 0
    assert run(folders, "out", "recorded", "--seed", "9") == 1
    assert "begun with other settings" in capsys.readouterr().err


# Bad input


def test_a_video_that_does_not_open(folders, capsys):
    (folders / "broken.mp4").write_bytes(b"no video")
    with pytest.raises(SourceError, match="does not open"):
        next(frames(folders / "broken.mp4"))
    assert run(folders, source="broken.mp4") == 1
    assert "broken.mp4" in capsys.readouterr().err
    assert not (folders / "out").exists()


@pytest.mark.parametrize("source", ["nowhere", "backgrounds/none"])
def test_a_source_without_pictures(folders, source):
    (folders / "backgrounds" / "none").mkdir()
    assert run(folders, source=source) == 1


def test_a_screen_that_is_not_one_color_is_refused_with_its_spread():
    picture = np.zeros((40, 90, 3), np.uint8)
    for k, color in enumerate([(20, 180, 20), (20, 60, 200), (200, 40, 20)]):
        picture[:, 30 * k : 30 * k + 30] = color
    with pytest.raises(ScreenError, match=r"not one color.*spread over \d{2,}°.*3\d% is screen"):
        find_ranges([picture])


def test_a_grey_or_a_wooden_screen_is_refused():
    with pytest.raises(ScreenError, match="no colored screen"):
        find_ranges([np.full((40, 40, 3), 128, np.uint8)])
    with pytest.raises(ScreenError, match="neither green nor blue"):
        find_ranges([np.full((40, 40, 3), (150, 100, 50), np.uint8)])


def test_an_empty_background_folder(folders, capsys):
    (folders / "backgrounds" / "red.png").unlink()
    with pytest.raises(ValueError, match="no background pictures"):
        open_backgrounds(folders / "backgrounds")
    assert run(folders) == 1
    assert "no background pictures" in capsys.readouterr().err


def test_a_mask_of_another_size_is_named(tmp_path):
    save(np.zeros((20, 30, 3), np.uint8), tmp_path / "imgs" / "a.png")
    save(np.full((21, 30, 3), 255, np.uint8), tmp_path / "masks" / "a.png")
    (sample,) = samples_in(tmp_path)
    with pytest.raises(DatasetError, match=r"a\.png is 30×21 but its picture a\.png is 30×20"):
        load(sample)
    assert load(sample, fit=True)[1].shape == (20, 30)


def test_pictures_without_a_mask_and_empty_folders_are_named(tmp_path):
    with pytest.raises(DatasetError, match="no labelled pictures"):
        samples_in(tmp_path)
    save(np.zeros((20, 30, 3), np.uint8), tmp_path / "b.jpg")
    with pytest.raises(DatasetError, match=r"1 pictures in .* have no mask: b\.jpg"):
        samples_in(tmp_path)


def test_the_index_alone_says_what_belongs_to_a_set(tmp_path):
    rgb, ids = np.zeros((8, 9, 3), np.uint8), np.zeros((8, 9), np.int16)
    for name in ("a", "b"):
        datasets.write_sample(tmp_path, name, rgb, ids)
    datasets.append_index(tmp_path, {"name": "a"})
    assert [s.name for s in samples_in(tmp_path)] == ["a"]
    assert json.loads((tmp_path / "index.jsonl").read_text())["name"] == "a"
