"""The renderer: geometry with known answers, labels that fit the picture, equal seeds."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from models.synthesis.canvas import Canvas, blur
from models.synthesis.clutter import PAINTERS
from models.synthesis.curves import CurveParams, coil, interpolate, parallel_curve, propagate
from models.synthesis.ends import terminal, tie
from models.synthesis.looks import _PATTERN, Light, Look, appearance
from models.synthesis.optics import jpeg
from models.synthesis.paint import mural
from models.synthesis.ribbons import rasterize, strand
from models.synthesis.scenes import SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool, pack

pytestmark = pytest.mark.no_cover  # of training and synthesis: nothing there is measured

CPU = torch.device("cpu")
NO_TEXTURES = TexturePool(())
FLAT = Light((0.0, 0.0, 1.0), ambient=1.0, shadow=0.0, softness=0, color=(1.0, 1.0, 1.0))


def straight(x0: float, y0: float, x1: float, y1: float, height: float = 0.5) -> np.ndarray:
    t = np.linspace(0, 1, 200)[:, None]
    xy = (1 - t) * (x0, y0) + t * (x1, y1)
    return np.concatenate([xy, np.full((200, 1), height)], 1).astype(np.float32)


def test_spline_passes_through_its_control_points():
    control = np.array([[0, 0, 0], [10, 5, 1], [20, -5, 0], [30, 0, 1]], np.float32)
    curve = interpolate(control, 0.05)
    nearest = [np.linalg.norm(curve - point, axis=1).min() for point in control]
    assert max(nearest) < 0.1


def test_propagation_steps_and_heights_stay_in_their_bounds():
    params = CurveParams((5.0, 8.0), turn_rad=0.3, wander_rad=0.1, n_control=40, height=(0.2, 0.9))
    points = propagate(np.random.default_rng(0), np.zeros(2, np.float32), 0.0, params)
    steps = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1)
    assert points.shape == (40, 3)
    assert steps.min() >= 5.0 - 1e-4
    assert steps.max() <= 8.0 + 1e-4
    assert points[:, 2].min() >= 0.2
    assert points[:, 2].max() <= 0.9


def test_parallel_neighbor_keeps_about_its_gap():
    curve = straight(0, 50, 200, 50)
    beside = parallel_curve(np.random.default_rng(0), curve, 10.0)
    assert np.abs(beside[:, 1] - 60).mean() < 6


def test_a_horizontal_ribbon_covers_exactly_its_width():
    """Width 6 about y = 20: rows 17 to 23 are touched, the outer two half covered."""
    ribbon = rasterize(
        strand(straight(-5, 20, 45, 20), np.full(200, 3.0, np.float32), CPU), (40, 40)
    )
    column = ribbon.index % 40 == 20
    rows = (ribbon.index[column] // 40).tolist()
    alpha = dict(zip(rows, ribbon.alpha[column].tolist(), strict=True))
    assert [r for r in range(40) if alpha.get(r, 0) > 0.01] == [17, 18, 19, 20, 21, 22, 23]
    assert alpha[17] == pytest.approx(0.5, abs=0.02)
    assert sum(alpha.values()) == pytest.approx(6.0, abs=0.05)


@pytest.mark.parametrize("pattern", ["plain", *_PATTERN])
def test_every_pattern_gives_finite_colors_and_opaque_middles(pattern):
    ribbon = rasterize(
        strand(straight(0, 20, 60, 20), np.full(200, 6.0, np.float32), CPU), (40, 60)
    )
    look = Look(
        (0.8, 0.2, 0.1),
        (0.1, 0.2, 0.9),
        pattern,
        12.0,
        gloss=0.5,
        shininess=30.0,
        grain=0.0,
        opacity=1.0,
    )
    color, alpha = appearance(ribbon, look, FLAT, 0, np.random.default_rng(0))
    assert color.expand(3, len(alpha)).shape == (3, len(ribbon.index))
    assert torch.isfinite(color).all()
    assert float(alpha[ribbon.offset.abs() < 0.5].min()) == 1.0


def test_a_transparent_cable_shows_the_ground_more_in_its_middle_than_at_its_rim():
    ribbon = rasterize(
        strand(straight(0, 20, 60, 20), np.full(200, 8.0, np.float32), CPU), (40, 60)
    )
    look = Look(
        (1, 1, 1), (1, 1, 1), "plain", 12.0, gloss=0.0, shininess=4.0, grain=0.0, opacity=0.5
    )
    _, alpha = appearance(ribbon, look, FLAT, 0, np.random.default_rng(0))
    assert float(alpha[ribbon.offset.abs() < 0.1].max()) < 0.55
    assert float(alpha[(ribbon.offset.abs() > 0.85) & (ribbon.alpha == 1)].min()) > 0.55


def test_a_coil_turns_around_more_than_once():
    curve = coil(np.random.default_rng(2), (192, 320), 8.0)
    heading = np.unwrap(np.arctan2(*np.diff(curve[:, 1::-1], axis=0).T))
    assert abs(heading[-1] - heading[0]) > 2 * np.pi


@pytest.mark.parametrize("radius", [1, 3, 4, 9])
def test_blur_keeps_the_mean_and_spreads(radius):
    plane = torch.zeros(64, 96)
    plane[30:34, 46:50] = 1.0
    soft = blur(plane, radius)
    assert soft.shape == plane.shape
    assert float(soft.sum()) == pytest.approx(16.0, rel=0.05)
    assert float(soft.max()) < 1.0


def test_drops_have_their_area_and_the_later_covers():
    canvas = Canvas(torch.zeros(3, 40, 40))
    colors = torch.tensor([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    canvas.drops(torch.tensor([[20.0, 20.0], [21.0, 20.0]]), torch.tensor([5.0, 3.0]), colors)
    assert canvas.rgb[1, 20, 21] == 1.0
    assert canvas.rgb[0, 20, 21] == 0.0
    assert canvas.rgb[0, 20, 16] == 1.0
    assert float(canvas.rgb.sum()) == pytest.approx(np.pi * 25, rel=0.06)


def test_a_lattice_has_as_many_parts_as_it_says():
    from skimage.measure import label

    canvas = Canvas(torch.zeros(3, 60, 90))
    canvas.lattice((45, 30), (5, 3), (12.0, 14.0), 0.0, (4.0, 5.0), (1.0, 1.0, 1.0))
    assert label(canvas.rgb[0].numpy() > 0.5).max() == 15
    assert float(canvas.rgb[0].sum()) == pytest.approx(15 * 8 * 10, rel=0.05)


def test_a_polygon_is_filled_inside_only():
    canvas = Canvas(torch.zeros(3, 40, 40))
    canvas.polygon([(10, 10), (30, 10), (30, 20), (10, 20)], (1.0, 1.0, 1.0))
    assert float(canvas.rgb[0].sum()) == pytest.approx(200, rel=0.05)
    assert canvas.rgb[0, 15, 20] == 1.0


@pytest.mark.parametrize("seed", range(8))
def test_connectors_and_ties_take_the_label_away(seed):
    canvas = Canvas(torch.full((3, 120, 160), 0.5))
    canvas.ids[:] = 7
    (tie if seed % 4 == 0 else terminal)(
        canvas, np.random.default_rng(seed), np.array([80.0, 60.0]), 0.3, 6.0
    )
    assert 0 < int((canvas.ids == 0).sum()) < 120 * 160 / 2


def test_fine_jpeg_changes_almost_nothing_and_coarse_jpeg_does():
    rgb = torch.rand(3, 19, 21, generator=torch.Generator().manual_seed(0))
    assert (jpeg(rgb, 1e-4) - rgb).abs().max() < 2e-3
    assert (jpeg(rgb, 0.3) - rgb).abs().max() > 0.05


def test_equal_seeds_give_equal_bytes_and_others_do_not():
    params = SceneParams(size=(96, 160))
    first, again, other = (
        to_uint8(render_scene(np.random.default_rng(seed), params, NO_TEXTURES).rgb)
        for seed in (3, 3, 4)
    )
    assert first.tobytes() == again.tobytes()
    assert first.tobytes() != other.tobytes()


def test_labels_lie_on_the_centerlines():
    """Where a cable is seen, its id is found on its own centerline; most of a cable is seen."""
    params = SceneParams(size=(192, 320), empty_share=0.0, max_cables=1)
    hits = 0
    for seed in range(6):
        scene = render_scene(np.random.default_rng(seed), params, NO_TEXTURES)
        xy = np.rint(scene.centerlines[0][:, :2]).astype(int)
        inside = (xy >= 0).all(1) & (xy < (320, 192)).all(1)
        seen = scene.ids.numpy()[xy[inside, 1], xy[inside, 0]]
        assert set(np.unique(scene.ids.numpy())) <= {0, 1}
        hits += np.mean(seen == 1) > 0.7 if inside.any() else 1
    assert hits >= 5


def test_empty_scenes_have_no_labels():
    params = SceneParams(size=(64, 96), empty_share=1.0)
    for seed in range(4):
        assert int(render_scene(np.random.default_rng(seed), params, NO_TEXTURES).ids.max()) == 0


@pytest.mark.slow
@pytest.mark.parametrize("painter", sorted({*PAINTERS, mural}, key=lambda p: p.__name__))
def test_clutter_paints_and_never_labels(painter):
    changed = 0
    for seed in range(3):
        canvas = Canvas(torch.full((3, 90, 160), 0.5))
        painter(canvas, np.random.default_rng(seed))
        changed += int((canvas.rgb != 0.5).any())
        assert int(canvas.ids.max()) == 0
        assert torch.isfinite(canvas.rgb).all()
    assert changed >= 1


def test_a_pack_holds_what_the_folder_held(tmp_path):
    import cv2

    (tmp_path / "in" / "wood").mkdir(parents=True)
    picture = np.full((32, 48, 3), (10, 20, 30), np.uint8)
    cv2.imwrite(str(tmp_path / "in" / "wood" / "a.png"), picture)
    assert pack(tmp_path / "in", tmp_path / "pack.npz") == 1
    pool = load_pool(tmp_path / "pack.npz")
    assert pool.groups[0][0][0, 0].tolist() == [30, 20, 10]
    sample = pool.sample(np.random.default_rng(0), (40, 60), CPU)
    assert sample.shape == (3, 40, 60)
    assert torch.allclose(sample[:, 5, 5] * 255, torch.tensor([30.0, 20.0, 10.0]), atol=0.5)


def test_an_empty_texture_folder_is_an_error(tmp_path):
    with pytest.raises(ValueError, match="no pictures"):
        load_pool(tmp_path)
