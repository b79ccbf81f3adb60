"""The default method: matching by hand, then what the published methods fail at, on drawn masks."""

from __future__ import annotations

from itertools import combinations

import cv2
import numpy as np
import pytest

from models.instances.section_matching import SectionMatchingParams, extract
from models.instances.section_matching.extraction import _stops
from models.instances.section_matching.links import FEATURES, GAP, candidate_links
from models.strands.cleaning import clean
from models.strands.foreground import Foreground, distance_map
from models.strands.pairing import match
from models.strands.pixel_graph import trace
from models.strands.sections import sections_of
from tests.models.drawn_masks import circle, colored, drawn, loop

RED, BLUE = (200, 30, 30), (30, 40, 190)


def total(partner, pairs, costs, stop) -> float:
    table = {(a, b): c for (a, b), c in zip(pairs.tolist(), costs, strict=True)}
    links = {(min(k, int(p)), max(k, int(p))) for k, p in enumerate(partner) if p != k}
    return sum(table[link] for link in links) + sum(
        stop[k] for k, p in enumerate(partner) if p == k
    )


def test_matching_takes_the_best_total_not_the_best_link():
    """Greedy takes 0-1 (cost -5) and is left with 2-3 (cost 6); together 0-2 and 1-3 cost less."""
    pairs, costs = np.array([[0, 1], [2, 3], [0, 2], [1, 3]]), np.array([-5.0, 6.0, -4.0, -4.0])
    assert match(4, pairs, costs, np.full(4, 2.0)).tolist() == [2, 3, 0, 1]


def test_an_end_stops_where_every_link_is_dearer():
    assert match(2, np.array([[0, 1]]), np.array([1.0]), np.zeros(2)).tolist() == [0, 1]
    assert match(2, np.array([[0, 1]]), np.array([1.0]), np.full(2, 2.0)).tolist() == [1, 0]


def test_a_section_along_which_only_one_strand_would_lead_is_not_shared():
    """Section 0 (ends 0, 1) given up, 2 and 4 would be joined at a lower total; but then nothing
    leads along it."""
    pairs = np.array([[2, 4], [0, 2], [0, 4], [6, 8], [4, 6], [0, 1]])
    costs = np.array([2.9, 2.2, -1.8, -8.0, -0.25, 1.0])
    via = np.array([-1, -1, -1, -1, 0, 0])
    partner = match(10, pairs, costs, np.full(10, 3.0), via)
    assert partner[[0, 4, 2, 1, 6]].tolist() == [4, 0, 2, 1, 8]


def test_a_stub_may_stop_at_a_crossing_for_less():
    """Two bars from border to border, and a stub of six radii on one of them."""
    bars = np.array([[0.0, 60.0], [319.0, 60.0]]), np.array([[60.0, 0.0], [60.0, 239.0]])
    mask = drawn(*bars, np.array([[200.0, 60.0], [200.0, 100.0]]))
    sections = sections_of(trace(Foreground.of(mask)), distance_map(mask), None)
    stops, at_crossing = _stops(sections, 3.0), sections.node >= 0
    stub = (sections.node[np.arange(len(stops)) ^ 1] < 0) & ~sections.at_border[
        np.arange(len(stops)) ^ 1
    ]
    assert np.count_nonzero(stub & at_crossing) == 1
    assert 0.5 < stops[stub & at_crossing].item() < 2.0
    assert (stops[at_crossing & ~stub] == 3.0).all()


def test_a_cable_that_bends_in_a_gap_is_seen_there():
    x = np.linspace(20.0, 300.0, 141)
    bump = np.where(np.abs(x - 160) < 40, np.sin((x - 120) / 80 * np.pi), 0.0)
    line = np.stack((x, 120 + 14 * bump), axis=1)
    mask = drawn(line)
    mask[:, 118:202] = False
    sections = sections_of(trace(Foreground.of(mask)), distance_map(mask), colored((line, RED)))
    links = candidate_links(sections, mask, colored((line, RED)), 20.0)
    (row,) = links.features[links.kind == GAP]
    assert row[FEATURES.index("seen_gap")] > 2 * row[FEATURES.index("gap")]


@pytest.mark.parametrize("seed", range(12))
def test_large_groups_are_matched_almost_as_cheaply_as_by_trying_everything(seed):
    """Groups above 8 ends go through the relaxation: compared with the exact solver on the same 10
    ends."""
    rng = np.random.default_rng(seed)
    pairs = np.array(list(combinations(range(10), 2)))
    costs, stop = rng.normal(1, 2, len(pairs)), np.full(10, 1.0)
    partner = match(10, pairs, costs, stop)
    assert (partner[partner] == np.arange(10)).all()
    best = _cheapest(
        tuple(range(10)), {tuple(p): c for p, c in zip(pairs.tolist(), costs, strict=True)}, stop
    )
    assert total(partner, pairs, costs, stop) <= best + 1.5


def _cheapest(ends, table, stop) -> float:
    if not ends:
        return 0.0
    first, rest = ends[0], ends[1:]
    options = [stop[first] + _cheapest(rest, table, stop)]
    options += [
        table[first, other] + _cheapest(tuple(e for e in rest if e != other), table, stop)
        for other in rest
        if table[first, other] < stop[first] + stop[other]
    ]
    return min(options)


def test_small_holes_are_filled_and_specks_go():
    mask = drawn(np.array([[20.0, 120.0], [300.0, 120.0]]), width=12)
    mask[118:122, 100:104] = False
    mask[10:13, 10:13] = True
    cleaned = clean(mask, 0.7)
    assert cleaned.mask[118:122, 100:104].all()
    assert not cleaned.mask[10:13, 10:13].any()
    assert cleaned.width_px == pytest.approx(12, abs=1.5)


@pytest.mark.parametrize("width", [5, 10])
def test_straight_bar(width):
    line = np.array([[40.0, 120.0], [280.0, 120.0]])
    (bar,) = extract(drawn(line, width=width)).instances
    assert np.abs(bar.centerline_xy[1:-1, 1] - 120).max() < 1.5  # the round caps left out
    assert bar.length_px == pytest.approx(240 + width, abs=8)
    assert bar.width_px == pytest.approx(width, abs=2)
    steps = np.hypot(*np.diff(bar.centerline_xy, axis=0).T)
    assert steps.max() / steps.min() < 1.1


@pytest.mark.parametrize("top", range(100, 104))
@pytest.mark.parametrize("width", [9, 10, 11, 12])
def test_width_and_middle_do_not_depend_on_where_the_strand_lies(top, width):
    """A halved mask's skeleton lay up to two pixels beside the middle, and a strand of 9 px was
    measured as 5."""
    mask = np.zeros((240, 320), bool)
    mask[top : top + width, 20:300] = True
    (bar,) = extract(mask).instances
    assert bar.width_px == pytest.approx(width, abs=1.1)
    assert np.abs(bar.centerline_xy[2:-2, 1] - (top + (width - 1) / 2)).max() < 1.1


def test_three_strands_through_one_place():
    angles = np.deg2rad([10, 70, 130])
    lines = [
        np.array([[160, 120]]) + np.array([[-100], [100]]) * np.array([np.cos(a), np.sin(a)])
        for a in angles
    ]
    scene = extract(drawn(*lines))
    assert len(scene.instances) == 3
    assert len(scene.crossings) == 3
    for instance in scene.instances:
        step = instance.centerline_xy[-1] - instance.centerline_xy[0]
        away = np.abs(np.angle(np.exp(2j * (np.arctan2(step[1], step[0]) - angles)))) / 2
        assert away.min() < np.deg2rad(5)


@pytest.mark.parametrize(
    ("width", "lines"),
    [
        (9, [((473, -129), (-144, 377)), ((527, 278), (-217, -13)), ((413, 435), (-70, -201))]),
        (13, [((-61, -209), (381, 456)), ((316, -252), (21, 490)), ((523, 256), (-221, -35))]),
        (16, [((-109, -169), (410, 438)), ((282, -278), (66, 492)), ((545, 219), (-229, 23))]),
        (16, [((-237, 23), (529, 252)), ((186, -279), (135, 518)), ((472, -122), (-182, 336))]),
    ],
)
def test_three_strands_through_nearly_one_place(width, lines):
    """A few pixels of skeleton between two of three crossings were a section of their own: one
    strand was cut."""
    mask = np.zeros((240, 320), np.uint8)
    for line in lines:
        cv2.line(mask, *line, 1, width)
    scene = extract(mask > 0)
    assert len(scene.instances) == 3
    assert all(i.length_px > 200 for i in scene.instances)


def test_loop_crosses_itself_once():
    (strand,) = extract(drawn(loop())).instances
    (crossing,) = extract(drawn(loop())).crossings
    assert not strand.closed
    assert (crossing.over.instance, crossing.under.instance) == (1, 1)


def test_ring_is_closed():
    scene = extract(drawn(circle((160, 120), 70)))
    (ring,) = scene.instances
    assert ring.closed
    assert ring.endpoints == ()
    assert scene.crossings == ()


def test_gap_is_bridged_and_labelled():
    mask = drawn(np.array([[20.0, 120.0], [300.0, 120.0]]))
    mask[:, 150:175] = False
    scene = extract(mask)
    assert len(scene.instances) == 1
    assert scene.labels[120, 160] == 1


def test_gap_between_unlike_strands_stays():
    """Same direction, same width, but one is red and one is blue, and background shows between."""
    left, right = (
        np.array([[20.0, 120.0], [140.0, 120.0]]),
        np.array([[180.0, 120.0], [300.0, 120.0]]),
    )
    scene = extract(drawn(left, right), colored((left, RED), (right, BLUE)))
    assert len(scene.instances) == 2


def test_shallow_crossing_is_one_crossing():
    one = np.array([[20.0, 100.0], [300.0, 140.0]])
    other = one * np.array([1, -1]) + np.array([0, 240])
    scene = extract(drawn(one, other))
    assert len(scene.instances) == 2
    assert all(abs(np.diff(i.centerline_xy[[0, -1], 1])[0]) > 30 for i in scene.instances)
    assert len(scene.crossings) == 1


def test_strands_that_touch_and_part_by_color():
    left = np.array([[40.0, 60.0], [140.0, 118.0], [180.0, 118.0], [280.0, 60.0]])
    right = left * np.array([1, -1]) + np.array([0, 240])
    scene = extract(drawn(left, right), colored((left, RED), (right, BLUE)))
    assert len(scene.instances) == 2
    assert all(np.ptp(i.centerline_xy[[0, -1], 1]) < 15 for i in scene.instances)


def test_parallel_strands_stay_apart():
    upper = np.array([[0.0, 100.0], [319.0, 100.0]])
    scene = extract(drawn(upper, upper + np.array([0, 13])))
    assert len(scene.instances) == 2
    assert {scene.labels[100, 160], scene.labels[113, 160]} == {1, 2}


def test_strands_that_meet_at_the_border_are_two():
    top, low = np.array([[20.0, 60.0], [319.0, 118.0]]), np.array([[20.0, 180.0], [319.0, 122.0]])
    scene = extract(drawn(top, low))
    assert len(scene.instances) == 2


def test_a_thin_mask_is_widened_to_the_edges_in_the_picture():
    """Eroded masks: the picture still shows where the cable ends."""
    line = np.array([[40.0, 120.0], [280.0, 120.0]])
    image = colored((line, RED), width=12)
    full = drawn(line, width=12)
    thin = cv2.erode(full.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=2) > 0
    scene = extract(thin, image)
    both, either = (scene.labels > 0) & full, (scene.labels > 0) | full
    assert both.sum() / either.sum() > 0.95
    assert scene.instances[0].width_px == pytest.approx(12.5, abs=1.5)
    assert np.count_nonzero(extract(thin).labels) <= np.count_nonzero(thin) + 20


def test_scores_are_probabilities_and_a_short_loose_piece_is_less_sure():
    long, short = (
        np.array([[20.0, 60.0], [319.0, 60.0]]),
        np.array([[150.0, 180.0], [205.0, 180.0]]),
    )
    scores = [i.score for i in extract(drawn(long, short)).instances]
    assert scores[0] > 0.8
    assert len(scores) == 1 or scores[1] < scores[0]


def test_same_input_gives_the_same_bytes():
    mask, image = drawn(loop()), colored((loop(), RED))
    first, second = extract(mask, image), extract(mask, image)
    assert first.labels.tobytes() == second.labels.tobytes()
    assert [i.score for i in first.instances] == [i.score for i in second.instances]


@pytest.mark.parametrize(
    "params",
    [
        SectionMatchingParams(0, 0, -5),
        SectionMatchingParams(4, 50, 20),
        SectionMatchingParams(0.7, 20, 0),
    ],
)
def test_extreme_parameters_do_no_harm(params):
    extract(drawn(loop()), None, params)


@pytest.mark.parametrize("angle", [20, 30, 40])
def test_a_zigzag_with_sharp_kinks_is_one_cable_or_unsure(angle):
    """Its legs were four cables, all of them sure: at a kink nothing but its two sides meets."""
    step = 200 * np.tan(np.deg2rad(angle) / 2)
    line = np.array([[60 + k * step, (60, 260)[k % 2]] for k in range(5)])
    scene = extract(drawn(line, width=12, shape=(330, 640)))
    assert len(scene.instances) == 1 or any(i.score < 0.8 for i in scene.instances)


@pytest.mark.parametrize("width", [1, 2, 80, 100])
@pytest.mark.parametrize("line", [[[40, 100], [600, 100]], [[30, 90], [320, 230], [610, 140]]])
def test_very_thin_and_very_thick_cables_are_found(width, line):
    """Lines of one pixel were specks, thick ones slabs of which scraps were left."""
    (cable,) = extract(drawn(np.array(line), width=width, shape=(360, 640))).instances
    assert cable.width_px == pytest.approx(width, rel=0.15, abs=1)
    assert cable.length_px == pytest.approx(np.hypot(*np.diff(line, axis=0).T).sum(), rel=0.15)
