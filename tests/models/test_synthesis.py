"""The renderer: geometry with known answers, labels that fit the picture, equal seeds."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from models.synthesis.cables import Light, Look, paint_cable
from models.synthesis.canvas import Canvas, shift
from models.synthesis.clutter import PAINTERS, mural
from models.synthesis.curves import CurveParams, interpolate, parallel_curve, propagate
from models.synthesis.optics import jpeg
from models.synthesis.ribbons import rasterize, strands
from models.synthesis.scenes import SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool, pack

CPU = torch.device("cpu")
NO_TEXTURES = TexturePool(())
FLAT = Light((0.0, 0.0, 1.0), ambient=1.0, shadow=0.0, softness=0, color=(1.0, 1.0, 1.0))


def straight(x0: float, y0: float, x1: float, y1: float, height: float = 0.5) -> np.ndarray:
    t = np.linspace(0, 1, 200)[:, None]
    xy = (1 - t) * (x0, y0) + t * (x1, y1)
    return np.concatenate([xy, np.full((200, 1), height)], 1).astype(np.float32)


def look(color: tuple[float, float, float]) -> Look:
    return Look(color, color, "plain", 10.0, gloss=0.0, shininess=4.0, grain=0.0, opacity=1.0)


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
    ribbon = rasterize(straight(-5, 20, 45, 20), np.full(200, 3.0, np.float32), (40, 40), CPU)
    column = ribbon.index % 40 == 20
    rows = (ribbon.index[column] // 40).tolist()
    alpha = dict(zip(rows, ribbon.alpha[column].tolist(), strict=True))
    assert [r for r in range(40) if alpha.get(r, 0) > 0.01] == [17, 18, 19, 20, 21, 22, 23]
    assert alpha[17] == pytest.approx(0.5, abs=0.02)
    assert sum(alpha.values()) == pytest.approx(6.0, abs=0.05)


def test_the_later_cable_owns_the_crossing():
    canvas = Canvas(torch.zeros(3, 60, 60))
    rng = np.random.default_rng(0)
    half = np.full(200, 4.0, np.float32)
    paint_cable(canvas, straight(0, 30, 60, 30), half, look((1.0, 0.0, 0.0)), FLAT, 1, rng)
    paint_cable(canvas, straight(30, 0, 30, 60), half, look((0.0, 0.0, 1.0)), FLAT, 2, rng)
    assert canvas.ids[30, 30] == 2
    assert canvas.ids[30, 10] == 1
    assert canvas.rgb[2, 30, 30] > 0.8
    assert canvas.rgb[0, 30, 30] < 0.05


def test_a_self_crossing_shows_its_higher_strand():
    """The strand with the larger height is on top, though it comes first along the curve."""
    curve = np.concatenate([straight(30, 0, 30, 60, height=0.9), straight(0, 30, 60, 30, height=0.1)])
    runs = strands(curve, 8)
    assert curve[runs[0], 2].mean() < curve[runs[-1], 2].mean()
    ribbon = rasterize(curve, np.full(400, 4.0, np.float32), (60, 60), CPU)
    center = ribbon.sample[ribbon.index == 30 * 60 + 30]
    assert curve[int(center), 2] == pytest.approx(0.9)


def test_shift_moves_and_fills_with_zeros():
    plane = torch.arange(12.0).view(3, 4)
    assert torch.equal(shift(plane, 1, 0)[:, 1:], plane[:, :-1])
    assert torch.equal(shift(plane, 0, -1)[:-1], plane[1:])
    assert float(shift(plane, 9, 0).abs().sum()) == 0


def test_fine_jpeg_changes_almost_nothing_and_coarse_jpeg_does():
    rgb = torch.rand(3, 19, 21, generator=torch.Generator().manual_seed(0))
    assert (jpeg(rgb, 1e-4) - rgb).abs().max() < 2e-3
    assert (jpeg(rgb, 0.3) - rgb).abs().max() > 0.05


def test_equal_seeds_give_equal_bytes_and_others_do_not():
    params = SceneParams(size=(96, 160))
    first, again, other = (
        to_uint8(render_scene(np.random.default_rng(seed), params, NO_TEXTURES).rgb) for seed in (3, 3, 4)
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
