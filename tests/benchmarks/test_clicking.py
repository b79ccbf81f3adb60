"""The simulated person, on masks with known answers, and the page's outline in node on drawn
pictures."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from models.geometry.arrays import BoolArray, ByteArray, FloatArray
from tests.benchmarks.bench_clicks import Page, corrected, needed, overlap
from tests.benchmarks.clicking import Person, best_drag, edge_px, true_line

SIZE = (120, 200)
NOTHING = np.zeros(SIZE, bool)


def bar(top: int, bottom: int, left: int = 0, right: int = 200) -> BoolArray:
    mask = np.zeros(SIZE, bool)
    mask[top:bottom, left:right] = True
    return mask


def test_the_true_line_runs_from_end_to_end_over_what_lies_on_top() -> None:
    """Before, a cable below two others was clicked on one of its pieces only, and could never be
    reached."""
    mask = bar(50, 61, 20, 180)
    mask[:, 60:90] = mask[:, 120:150] = False
    line = true_line(mask)
    assert sorted([line[0, 0], line[-1, 0]]) == pytest.approx([20, 179])
    assert np.abs(line[:, 1] - 55).max() <= 1


def test_an_edge_is_where_the_mask_ends_and_unknown_under_another_cable() -> None:
    mask, other = bar(50, 61), bar(61, 70, 100, 120)
    below = np.array([0.0, 1.0])
    assert edge_px(mask, NOTHING, np.array([40.0, 55.0]), below) == pytest.approx(5.5, abs=0.15)
    assert edge_px(mask, NOTHING, np.array([40.0, 58.0]), below) == pytest.approx(2.5, abs=0.15)
    assert np.isnan(edge_px(mask, other, np.array([110.0, 55.0]), below))


def test_one_drag_takes_what_leaves_least() -> None:
    assert best_drag(-1.0, -1.0) == (-1.0, -1.0), "both together"
    assert best_drag(-1.0, 1.0) == (-1.0, 1.0), "the width"
    assert best_drag(0.0, 2.0) == (0.0, 2.0), "one edge"


def test_the_person_clicks_where_the_outline_left_the_cable() -> None:
    person = Person(bar(50, 61), NOTHING)
    assert person.actions == 2
    drawn = bar(50, 61)
    drawn[:, 80:120] = False
    line = np.stack([np.arange(200.0), np.full(200, 55.0)], 1)
    edges = {"low": [-5.5] * 200, "high": [5.5] * 200, "normals": [[0, 1]] * 200}
    assert person.act({"line": line.tolist(), "mask": drawn, **edges})
    assert len(person.clicks) == 3
    assert 85 < sorted(person.clicks)[1][0] < 115


def test_the_person_stops_where_nothing_is_off() -> None:
    person = Person(bar(50, 61), NOTHING)
    line = [[x, 55.0] for x in range(200)]
    drawn = {
        "line": line,
        "low": [-5.5] * 200,
        "high": [5.5] * 200,
        "normals": [[0, 1]] * 200,
        "mask": person.mask,
    }
    assert not person.act(drawn)


@pytest.fixture(scope="module")
def page() -> Iterator[Page]:
    if not shutil.which("node"):
        pytest.skip("needs node")
    page = Page()
    yield page
    page.close()


def wave(width_from: float, width_to: float) -> tuple[BoolArray, FloatArray]:
    """A curved cable from border to border whose width changes evenly."""
    x = np.linspace(0, 199, 400)
    y = 60 + 25 * np.sin(x / 35)
    away = np.full(SIZE, np.inf)
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    for (cx, cy), width in zip(
        np.stack([x, y], 1), np.linspace(width_from, width_to, 400), strict=True
    ):
        away = np.minimum(away, np.hypot(columns - cx, rows - cy) / (width / 2))
    return away <= 1, np.stack([x, y], 1)


def request(
    tmp_path: Path, mask: BoolArray, seen: BoolArray, rng: np.random.Generator
) -> dict[str, object]:
    """A red cable where ``mask`` is, on gray noise; the network has ``seen`` something else."""
    picture = rng.normal(120, 12, (*SIZE, 3))
    picture[mask] = np.array([180, 50, 40]) + rng.normal(0, 6, (int(mask.sum()), 1))
    rgb: ByteArray = cv2.GaussianBlur(picture, (0, 0), 0.7).clip(0, 255).astype(np.uint8)
    name = f"{rng.integers(1 << 30)}"
    (tmp_path / f"{name}.rgb").write_bytes(rgb.tobytes())
    (tmp_path / f"{name}.map").write_bytes((seen * 255).astype(np.uint8).tobytes())
    files = {"rgb": str(tmp_path / f"{name}.rgb"), "map": str(tmp_path / f"{name}.map")}
    return {**files, "width": SIZE[1], "height": SIZE[0]}


def test_the_outline_follows_the_picture_and_its_width_the_cable(
    page: Page, tmp_path: Path
) -> None:
    """The network's mask is two pixels too thin on either side, and says nothing of the
    perspective."""
    mask, line = wave(9, 16)
    thin, _ = wave(6, 6)
    ends = {"clicks": [line[0].tolist(), line[-1].tolist()], "pulls": []}
    drawn = page.draw({**request(tmp_path, mask, thin, np.random.default_rng(1)), **ends})
    assert (
        overlap(drawn["mask"], mask, NOTHING) > 0.93
    )  # it lies 0.35 px outside of the drawn edge, as people label
    assert overlap(thin, mask, NOTHING) < 0.6
    width = 2 * np.array(drawn["high"])
    assert width[20] == pytest.approx(9.5, abs=1.2)
    assert width[-20] == pytest.approx(15.5, abs=1.2)


def test_what_the_network_missed_is_found_by_the_color_of_the_clicks(
    page: Page, tmp_path: Path
) -> None:
    mask, line = wave(10, 10)
    ends = {"clicks": [line[2].tolist(), line[-3].tolist()], "pulls": []}
    drawn = page.draw({**request(tmp_path, mask, NOTHING, np.random.default_rng(2)), **ends})
    assert overlap(drawn["mask"], mask, NOTHING) > 0.9


def pulled_in_the_middle(page: Page, folder: Path) -> tuple[dict, dict, int, np.ndarray]:
    """What is drawn before and after the upper edge was pulled out by a pixel, at which cut, and to
    where."""
    mask, line = wave(10, 10)
    question = request(folder, mask, mask, np.random.default_rng(3))
    ends = {"clicks": [line[0].tolist(), line[-1].tolist()]}
    free = page.draw({**question, **ends, "pulls": []})
    i = len(free["line"]) // 2
    at = np.array(free["line"][i]) + (free["high"][i] + 1.0) * np.array(free["normals"][i])
    return free, page.draw({**question, **ends, "pulls": [{"at": at.tolist(), "side": 1}]}), i, at


def test_a_pulled_edge_passes_where_it_was_pulled_to(page: Page, tmp_path: Path) -> None:
    free, pulled, i, at = pulled_in_the_middle(page, tmp_path)
    upper = np.array(pulled["line"]) + np.array(pulled["high"])[:, None] * np.array(
        pulled["normals"]
    )
    assert np.linalg.norm(upper - at, axis=1).min() < 0.75
    lower = [
        np.array(d["line"])[i] + d["low"][i] * np.array(d["normals"])[i] for d in (free, pulled)
    ]
    assert np.linalg.norm(lower[0] - lower[1]) < 0.75, "the other edge stays"


def test_a_pull_moves_the_far_ends_of_the_edge_by_less_than_half(
    page: Page, tmp_path: Path
) -> None:
    """A person pulls where it is worst: six tenths of that on the whole edge spoiled what was right
    elsewhere."""
    free, pulled, i, _ = pulled_in_the_middle(page, tmp_path)
    moved = np.array(pulled["high"]) - pulled["low"] - (np.array(free["high"]) - free["low"])
    assert moved[i] == pytest.approx(1.0, abs=0.3)
    assert 0.2 < np.mean([*moved[:8], *moved[-8:]]) < 0.45


def test_what_moves_the_whole_cable_comes_after_what_the_picture_shows(
    page: Page, tmp_path: Path
) -> None:
    """An outline goes back to the picture's edges, wherever its clicks are: nobody could move
    it."""
    mask, line = wave(10, 10)
    question = request(tmp_path, mask, mask, np.random.default_rng(3))
    by, wider = np.array([1.5, -3.0]), 0.75
    free = page.draw({**question, "clicks": line[[0, -1]].tolist(), "pulls": []})
    moved = page.draw(
        {**question, "clicks": free["clicks"], "whole": {"by": by.tolist(), "wider": 0.0}}
    )
    wide = page.draw(
        {**question, "clicks": moved["clicks"], "whole": {"by": [0, 0], "wider": wider}}
    )
    assert np.allclose(np.array(wide["line"]), np.array(free["line"]) + by)
    assert np.allclose(wide["high"], np.array(free["high"]) + wider)
    assert np.allclose(wide["low"], np.array(free["low"]) - wider)
    again = page.draw({**question, "clicks": wide["clicks"], "pulls": wide["pulls"]})
    assert np.allclose(again["line"], wide["line"])
    assert np.allclose(again["high"], wide["high"])
    low = page.draw(
        {**question, "clicks": wide["clicks"], "whole": {"by": [0, 0], "wider": wider, "side": -1}}
    )
    assert np.allclose(low["low"], np.array(wide["low"]) - wider)
    assert np.allclose(low["high"], wide["high"]), "the other edge stays"
    page.draw({**question, "clicks": wide["clicks"], "pulls": wide["pulls"]})
    i = len(wide["line"]) // 2
    at = np.array(wide["line"][i]) + (wide["high"][i] + 1.0) * np.array(wide["normals"][i])
    pulls = [*wide["pulls"], {"at": at.tolist(), "side": 1}]
    pulled = page.draw({**question, "clicks": wide["clicks"], "pulls": pulls})
    upper = np.array(pulled["line"]) + np.array(pulled["high"])[:, None] * np.array(
        pulled["normals"]
    )
    assert np.linalg.norm(upper - at, axis=1).min() < 0.75, (
        "a pull that comes later is meant where it was made"
    )


def test_a_cable_of_the_service_is_moved_as_it_is_shown(page: Page, tmp_path: Path) -> None:
    mask, line = wave(10, 10)
    question = request(tmp_path, mask, mask, np.random.default_rng(6))
    given = page.draw({**question, "instance": found(line)})
    moved = page.draw(
        {**question, "clicks": given["clicks"], "whole": {"by": [2, 0], "wider": 0.0}}
    )
    assert np.allclose(np.array(moved["line"]), np.array(given["line"]) + np.array([2, 0]))
    assert moved["pulls"] == [], "an outline that is found later begins with the picture"


def test_the_person_drags_the_whole_cable_where_it_is_off_alike_all_along(
    page: Page, tmp_path: Path
) -> None:
    mask, _ = wave(10, 10)
    label = np.roll(mask, (-2, 1), (0, 1))
    person = Person(label, NOTHING)
    count, ious = needed(page, request(tmp_path, mask, mask, np.random.default_rng(8)), person)
    assert ious[0] < 0.8
    assert count == 3
    assert [set(one) for one in person.pulls] == [{"by", "wider"}]
    assert person.pulls[0]["by"] == pytest.approx([1, -2], abs=0.4)


@pytest.mark.parametrize("rows", [-2, 3], ids=["moved", "one edge"])
def test_a_hand_that_shakes_shakes_in_every_drag(page: Page, tmp_path: Path, rows: int) -> None:
    """A drag that changed the width, or one edge all along, was always exact."""
    mask, _ = wave(10, 10)
    label = np.roll(mask, rows, 0) | (mask if rows > 0 else NOTHING)
    question = request(tmp_path, mask, mask, np.random.default_rng(8))
    drawn = page.draw({**question, "clicks": Person(mask, NOTHING).clicks, "pulls": []})
    drags = []
    for hand_px in (0.0, 0.0, 1.5):
        person = Person(label, NOTHING, hand_px)
        assert person.act(drawn)
        assert person.whole
        drags.append([*person.whole["by"], person.whole["wider"]])
    assert drags[0] == drags[1]
    assert 0.1 < np.abs(np.subtract(drags[2], drags[0])).max() < 5


def test_the_person_drags_one_edge_where_only_that_one_is_off(page: Page, tmp_path: Path) -> None:
    mask, _ = wave(10, 10)
    label = mask | np.roll(mask, 3, 0)
    person = Person(label, NOTHING)
    count, ious = needed(page, request(tmp_path, mask, mask, np.random.default_rng(8)), person)
    assert ious[0] < 0.85
    assert count == 3
    (pull,) = person.pulls
    assert (abs(pull["side"]), pull["wider"]) == (1, pytest.approx(2.5, abs=0.6))


def found(line: FloatArray) -> dict[str, object]:
    """A cable of the service."""
    return {"centerline_xy": line[::4].tolist(), "width_px": 10.0}


def test_an_end_that_is_dragged_back_takes_the_clicks_with_it_that_it_passes(
    page: Page, tmp_path: Path
) -> None:
    """They were kept: the line went back from the new end to them."""
    mask, line = wave(10, 10)
    question = request(tmp_path, mask, mask, np.random.default_rng(5))
    first = page.draw({**question, "clicks": line[[0, 100, 200, -1]].tolist(), "pulls": []})
    to = line[300].tolist()
    drawn = page.draw(
        {**question, "clicks": first["clicks"], "pulls": [], "moved": {"index": 0, "to": to}}
    )
    assert drawn["clicks"] == [to, line[-1].tolist()]
    assert not drawn["mask"][:, :140].any()
    assert overlap(drawn["mask"][:, 155:], mask[:, 155:], NOTHING[:, 155:]) > 0.8
    page.draw({**question, "clicks": first["clicks"], "pulls": []})
    other = page.draw(
        {
            **question,
            "clicks": first["clicks"],
            "pulls": [],
            "moved": {"index": len(first["line"]) - 1, "to": to},
        }
    )
    assert other["clicks"] == [*first["clicks"][:-1], to]


def test_a_person_drags_a_cable_of_the_service_back_first(page: Page, tmp_path: Path) -> None:
    """One that went on over a plug was at 77 % after twenty drags at its edges."""
    mask, line = wave(10, 10)
    true = mask.copy()
    true[:, :80] = False
    question = request(tmp_path, mask, mask, np.random.default_rng(6))
    person = Person(true, NOTHING)
    given = page.draw({**question, "instance": found(line)})
    person.corrects(given)
    assert person.actions == 0
    assert person.act(given)
    assert person.actions == 1
    drawn = page.draw({**question, "clicks": person.clicks, "pulls": [], "moved": person.moved})
    assert overlap(drawn["mask"], true, NOTHING) > 0.85


def test_what_the_service_found_right_needs_nothing(page: Page, tmp_path: Path) -> None:
    mask, line = wave(10, 10)
    question = request(tmp_path, mask, mask, np.random.default_rng(7))
    item = SimpleNamespace(centerline_xy=line[::4], width_px=10.0)
    scene = SimpleNamespace(instances=[item], labels=mask.astype(np.uint8))
    assert corrected(page, question, Person(mask, NOTHING), scene, (5, [0.2])) == (0, [1.0])
    piece = SimpleNamespace(
        instances=[item, item], labels=np.where(np.arange(SIZE[1]) < 190, mask, 2 * mask)
    )
    assert corrected(page, question, Person(mask, NOTHING), piece, (5, [0.2]))[0] == 1, (
        "the piece is removed"
    )
    small = SimpleNamespace(instances=[item], labels=np.where(np.arange(SIZE[1]) < 80, mask, 0))
    assert corrected(page, question, Person(mask, NOTHING), small, (5, [0.2])) == (6, [0.2]), (
        "drawn anew"
    )


def test_the_same_wishes_come_true_in_the_loop(page: Page, tmp_path: Path) -> None:
    """A person who wants the label two pixels wider than the picture shows it gets it in a few
    drags."""
    mask, _ = wave(12, 12)
    wider, _ = wave(16, 16)
    count, ious = needed(
        page, request(tmp_path, mask, mask, np.random.default_rng(4)), Person(wider, NOTHING)
    )
    assert ious[0] < 0.9
    assert count <= 5
