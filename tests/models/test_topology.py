"""Mask to topology with the shipped networks: drawn masks with known answers, random scenes, and
what is no harness."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
import torch

from models.synthesis.harness import HarnessParams
from models.synthesis.harness_growth import make_harness
from models.synthesis.harness_masks import PLAIN, MaskParams, draw_mask
from models.topology import order
from models.topology.classifiers import Classifiers
from models.topology.encodings import EDGE_FEATURES, NODE_FEATURES, PATCH
from models.topology.extraction import extract
from models.topology.graph import initialize
from models.topology.scene import Topology
from models.training.topology.graphs import draw_scene, true_graph
from models.training.topology.network_topology import MessageLayer, TopologyNetwork
from models.weights.inference import Network
from tests.benchmarks.topology_scoring import Tally, link_dice, points_of
from tests.models.drawn_masks import circle, colored, drawn, loop
from tests.models.harnesses import shipped

CROSS = (np.array([[40, 40], [280, 200]]), np.array([[40, 200], [280, 40]]))


@pytest.fixture(scope="module")
def networks() -> tuple[Network, Classifiers]:
    return shipped()


def found(networks, mask: np.ndarray, **more) -> Topology:
    return extract(mask, *networks, **more)


def counts(topology: Topology) -> tuple[int, int, int]:
    return len(topology.sections), len(topology.branch_points), len(topology.crossings)


def test_a_plain_cable_is_one_section_from_tip_to_tip(networks):
    topology = found(networks, drawn(np.array([[40, 100], [280, 140]])))
    assert topology.status == "plain"
    assert counts(topology) == (1, 0, 0)
    assert topology.sections[0].length == pytest.approx(np.hypot(240, 40) + 10, abs=6)
    assert topology.sections[0].ends == ("free", "free")


def test_a_branch_is_a_branch_point_of_three_sections(networks):
    topology = found(
        networks,
        drawn(np.array([[0, 120], [319, 120]]), np.array([[160, 120], [230, 239]]), width=12),
    )
    assert topology.status == "branched"
    assert counts(topology) == (3, 1, 0)
    assert sorted(topology.branch_points[0].sections) == [0, 1, 2]
    assert np.hypot(*np.subtract(topology.branch_points[0].xy, (160, 120))) < 10
    assert {e for s in topology.sections for e in s.ends} == {"branch", "border"}


def test_two_cables_that_cross_are_two_sections(networks):
    topology = found(networks, drawn(*CROSS))
    assert counts(topology) == (2, 0, 1)
    (crossing,) = topology.crossings
    assert np.hypot(*np.subtract(crossing.xy, (160, 120))) < 6
    assert {crossing.over.section, crossing.under.section} == {0, 1}
    assert crossing.over.u == pytest.approx(0.5, abs=0.05)
    assert crossing.order_score == 0.5


def lens() -> tuple[np.ndarray, np.ndarray]:
    """Two cables that cross twice and lie nearly upon one another in between, at x from 130 to
    190."""
    x = np.linspace(20, 300, 200)
    off = 3 * ((x - 160) ** 2 / 30**2 - 1)
    return np.stack((x, 120 + off), axis=1), np.stack((x, 120 - off), axis=1)


def test_two_cables_that_lie_upon_one_another_cross_twice(networks):
    topology = found(networks, drawn(*lens(), width=10))
    assert counts(topology) == (2, 0, 2)
    assert sorted(c.xy[0] for c in topology.crossings) == pytest.approx([130, 190], abs=17)
    assert all({c.over.section, c.under.section} == {0, 1} for c in topology.crossings)


def test_a_loop_that_is_cut_on_both_sides_of_its_upper_pass_still_crosses_itself(networks):
    """The bridge over the cut leads over the strand that it belongs to."""
    start, end = np.array([80.0, 230.0]), np.array([240.0, 230.0])
    mask = drawn(
        np.concatenate(([start], circle((160, 75), 50, 0.6, -np.pi - 0.6), [end])), width=11
    )
    (crossing,) = found(networks, mask).crossings
    passes = [(tip - crossing.xy) / np.hypot(*(tip - crossing.xy)) for tip in (start, end)]
    upper, cut = (
        drawn(crossing.xy + np.array([[-n], [n]]) * way, width=w)
        for way, n, w in zip(passes, (30, 12), (11, 15), strict=True)
    )
    topology = found(networks, mask & ~(cut & ~upper))
    assert counts(topology) == (1, 0, 1)
    assert np.hypot(*np.subtract(topology.crossings[0].xy, crossing.xy)) < 6


def test_a_self_loop_is_one_section_that_crosses_itself(networks):
    topology = found(networks, drawn(loop(), width=9))
    assert counts(topology) == (1, 0, 1)
    (crossing,) = topology.crossings
    assert crossing.over.section == crossing.under.section
    assert abs(crossing.over.u - crossing.under.u) > 0.3


def test_a_branch_and_a_crossing_in_one_picture(networks):
    """As the thesis's WH1: a thin branch leaves the trunk and comes back over it."""
    mask = drawn(np.array([[10, 80], [310, 80]]), width=14)
    branch = np.array([[90, 80], [95, 150], [140, 190], [200, 170], [230, 80], [250, 20]])
    mask |= drawn(cv2.blur(branch.astype(np.float32), (1, 1)), width=7)
    assert counts(found(networks, mask)) == (3, 1, 1)


def test_a_ring_is_closed(networks):
    topology = found(networks, drawn(circle((160, 120), 80)))
    assert topology.status == "closed"
    assert topology.sections[0].closed
    assert counts(topology) == (1, 0, 0)


@pytest.mark.parametrize(
    "mask", [np.zeros((120, 160), bool), np.ones((120, 160), bool), np.eye(3, dtype=bool)]
)
def test_no_harness_is_an_answer(networks, mask):
    topology = found(networks, mask)
    assert counts(topology)[1:] == (0, 0)
    # A picture that is all foreground was a "plain" topology of one strand.
    assert (
        topology.status == "unsure" if mask.mean() == 1 else topology.status in ("empty", "plain")
    )


def test_noise_is_said_to_be_too_complex(networks):
    topology = found(networks, np.random.default_rng(1).random((400, 600)) > 0.5)
    assert topology.status == "too_complex"
    assert counts(topology) == (0, 0, 0)


def test_a_gap_in_a_cable_is_bridged(networks):
    mask = drawn(np.array([[20, 120], [300, 120]]), width=12)
    mask[:, 150:160] = False
    topology = found(networks, mask)
    assert len(topology.sections) == 1
    assert 0.9 < topology.sections[0].score < 1


def test_a_strand_that_the_upper_one_interrupts_goes_on_behind_it(networks):
    """Once two ends facing each other across a strand gave no crossing, and one end a
    branch-point."""
    mask = drawn(np.array([[20, 120], [300, 120]]), width=20)
    both = mask | drawn(
        np.array([[160, 20], [160, 102]]), np.array([[160, 138], [160, 220]]), width=10
    )
    assert counts(found(networks, both)) == (2, 0, 1)
    one = mask | drawn(
        np.array([[160, 20], [160, 120]]), np.array([[160, 142], [160, 220]]), width=10
    )
    assert counts(found(networks, one)) == (2, 0, 1)


def test_a_slit_within_a_bundle_is_no_cycle(networks):
    mask = drawn(np.array([[20, 120], [300, 120]]), width=20)
    mask[119:122, 120:180] = False
    assert counts(found(networks, mask)) == (1, 0, 0)


def test_a_clip_is_no_section(networks):
    mask = drawn(np.array([[20, 120], [300, 120]]), width=14)
    mask[100:116, 150:158] = True
    assert counts(found(networks, mask)) == (1, 0, 0)


def test_a_clip_between_two_cables_joins_nothing(networks):
    """Once the rung between them gave a section and two branch-points."""
    mask = drawn(np.array([[20, 100], [300, 100]]), np.array([[20, 126], [300, 126]]), width=12)
    mask[100:126, 155:161] = True
    assert counts(found(networks, mask)) == (2, 0, 0)


def test_a_branch_that_a_gap_cuts_off_is_one(networks):
    mask = drawn(np.array([[0, 120], [319, 120]]), np.array([[160, 120], [230, 239]]), width=12)
    mask[131:139, 150:190] = False
    topology = found(networks, mask)
    assert counts(topology) == (3, 1, 0)
    assert np.hypot(*np.subtract(topology.branch_points[0].xy, (160, 120))) < 14


def test_a_cable_that_ends_far_from_another_is_not_joined_to_it(networks):
    mask = drawn(np.array([[0, 60], [319, 60]]), np.array([[160, 120], [160, 239]]), width=12)
    assert counts(found(networks, mask)) == (2, 0, 0)


def test_a_large_picture_is_answered_in_its_own_pixels(networks):
    small = drawn(*CROSS)
    large = cv2.resize(small.astype(np.uint8), (3200, 2400), interpolation=cv2.INTER_NEAREST) > 0
    topology = found(networks, large)
    assert topology.size == (2400, 3200)
    assert np.hypot(*np.subtract(topology.crossings[0].xy, (1600, 1200))) < 60
    assert topology.sections[0].width == pytest.approx(
        10 * found(networks, small).sections[0].width, rel=0.15
    )


def test_an_image_of_another_size_is_refused(networks):
    with pytest.raises(ValueError, match="does not belong"):
        found(networks, drawn(*CROSS), image=np.zeros((10, 10, 3), np.uint8))


def upper(topology: Topology) -> float:
    """Slope of the upper section's ends: negative for the one that rises to the right."""
    section = topology.sections[topology.crossings[0].over.section]
    step = section.xy[-1] - section.xy[0]
    return float(step[1] / step[0])


@pytest.mark.parametrize("first", [0, 1])
def test_the_picture_tells_which_is_on_top(networks, first):
    strands = [(CROSS[0], (200, 40, 40)), (CROSS[1], (40, 60, 200))]
    ordered = strands if first == 0 else strands[::-1]
    topology = found(networks, drawn(*CROSS), image=colored(*ordered))
    expected = (
        1 if first == 1 else -1
    )  # the later one is on top; the second strand rises to the right
    assert np.sign(upper(topology)) == expected
    assert topology.crossings[0].order_score > 0.8


def test_depth_tells_which_is_on_top(networks):
    depth = np.full((240, 320), 1.0, np.float32)
    depth[drawn(CROSS[0])] = 0.99
    depth[drawn(CROSS[1])] = 0.97
    topology = found(networks, drawn(*CROSS), surfaces=[order.depth_map(depth)])
    assert upper(topology) < 0
    assert topology.crossings[0].order_score > 0.8


def test_points_in_space_tell_which_is_on_top_and_far_ones_do_not(networks):
    xy = np.concatenate([np.linspace(line[0], line[1], 150) for line in CROSS])
    depth = np.concatenate((np.full(150, 0.97), np.full(150, 0.99)))
    hidden = (np.arange(300) >= 150) & (np.hypot(*(xy - [160, 120]).T) < 8)
    topology = found(networks, drawn(*CROSS), surfaces=[order.points(xy[~hidden], depth[~hidden])])
    assert upper(topology) > 0
    nowhere = order.points(np.array([[5.0, 5.0]]), np.array([1.0]))
    assert found(networks, drawn(*CROSS), surfaces=[nowhere]).crossings[0].order_score == 0.5


def test_the_same_mask_gives_the_same_answer(networks):
    mask = drawn(*CROSS, loop())
    first, second = found(networks, mask), found(networks, mask)
    assert all(
        np.array_equal(a.xy, b.xy) for a, b in zip(first.sections, second.sections, strict=True)
    )
    assert first.crossings[0].xy == second.crossings[0].xy


@pytest.mark.slow
def test_random_scenes_are_read_right(networks):
    """A small part of the benchmark's floor: link Dice .944, branch-points .915, crossings .949 on
    280 scenes."""
    branch, crossing, dice = Tally(), Tally(), []
    for k in range(24):
        rng = np.random.default_rng([77, k])
        harness = make_harness(rng, HarnessParams(branch_points=(1, 4), crossings=(0, 4)))
        mask = draw_mask(harness, rng, MaskParams(gaps=0.2))
        topology, graph = found(networks, mask), initialize(mask)
        branch.add(points_of(topology.branch_points), harness.branch_xy, 25)
        crossing.add(points_of(topology.crossings), points_of(harness.crossings), 25)
        dice.append(link_dice(topology.links, true_graph(harness, graph).pairs))
    assert np.mean(dice) > 0.944
    assert branch.f1 > 0.9
    assert crossing.f1 > 0.9


def test_a_seed_gives_the_same_harness_and_its_labels_fit_its_mask():
    (harness, graph), (_, again) = (
        draw_scene(np.random.default_rng(3), HarnessParams(), PLAIN) for _ in range(2)
    )
    assert np.array_equal(graph.xy, again.xy)
    truth = true_graph(harness, graph)
    assert np.array_equal(truth.links, true_graph(harness, again).links)
    assert truth.on.mean() > 0.97
    true_length = sum(3.0 * (len(s.xy) - 1) for s in harness.sections)
    assert graph.web.strands
    assert sum(s.length for s in graph.web.strands) == pytest.approx(true_length, rel=0.2)


def test_asked_for_crossings_and_branch_points_are_there():
    params = HarnessParams(
        branch_points=(3, 3), harnesses=(1, 1), cables=(0, 0), cycle_share=0.0, crossings=(2, 2)
    )
    harness = make_harness(np.random.default_rng(8), params)
    assert len(harness.branch_xy) == 3
    assert len(harness.crossings) == 2
    assert len(harness.sections) == 3 * 2 + 1


def test_messages_are_summed_over_neighbors():
    """The layer of thesis 6.5.3 by hand: W = B = K = S = 1 on one feature, no bias."""
    layer = MessageLayer(1)
    for linear in (layer.neighbor, layer.own, layer.edge, layer.skip):
        torch.nn.init.ones_(linear.weight)
        if linear.bias is not None:
            torch.nn.init.zeros_(linear.bias)
    out = layer(
        torch.tensor([[1.0], [2.0], [4.0]]),
        torch.tensor([[0, 1], [1, 2]]),
        torch.tensor([[10.0], [20.0]]),
    )
    assert out[:, 0].tolist() == [1 + 10 + 2 + 1, (1 + 2 + 10) + (4 + 2 + 20) + 2, 2 + 20 + 4 + 4]


@pytest.mark.parametrize(("nodes", "edges"), [(60, 250), (3, 0), (1, 0), (400, 1800)])
def test_the_shipped_network_takes_any_number_of_nodes_and_edges(networks, nodes, edges):
    rng = np.random.default_rng(nodes)
    links, orientations, classes = networks[0].run(
        rng.random((nodes, PATCH, PATCH), np.float32),
        rng.random((nodes, NODE_FEATURES), np.float32),
        rng.integers(0, nodes, (2, edges)),
        rng.random((edges, EDGE_FEATURES), np.float32),
    )
    assert links.shape == (edges,)
    assert orientations.shape == (nodes, 180)
    assert classes.shape == (nodes, 2)
    assert all(
        np.isfinite(o).all() and (o >= 0).all() and (o <= 1).all()
        for o in (links, orientations, classes)
    )


def test_several_graphs_at_once_give_what_each_gives_alone():
    """What training collates must not mix."""
    torch.manual_seed(0)
    network = TopologyNetwork().eval()
    parts = [
        (
            torch.rand(n, PATCH, PATCH),
            torch.rand(n, NODE_FEATURES),
            torch.randint(0, n, (2, e)),
            torch.rand(e, EDGE_FEATURES),
        )
        for n, e in ((5, 8), (7, 11))
    ]
    joined = [torch.cat(p) for p in zip(*[(a, b, d) for a, b, _, d in parts], strict=True)]
    edges = torch.cat((parts[0][2], parts[1][2] + 5), dim=1)
    with torch.no_grad():
        together = network(joined[0], joined[1], edges, joined[2])
        alone = [network(*part) for part in parts]
    for k in range(3):
        assert torch.allclose(together[k], torch.cat([a[k] for a in alone]), atol=1e-5)
