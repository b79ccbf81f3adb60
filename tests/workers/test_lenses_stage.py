"""Every lens model through ``reconstruct``, with both methods, and ``label_tracked``."""

from __future__ import annotations

import numpy as np
import pytest
from dlo_client.contracts import (
    CameraInfo,
    LabelTrackedRequest,
    PinholeIntrinsics,
    ReconstructRequest,
    Stroke,
)

from models.geometry.cameras import Intrinsics
from models.reconstruction.curves import distances
from models.synthesis.arm import camera_above
from models.synthesis.views import Cable3D, Scene3D, noise_texture, random_cable, render
from tests.workers.test_reconstruct_stage import view
from workers import stages

pytestmark = pytest.mark.slow

RADIUS_M = 0.0018
LENSES = {
    "plumb_bob": (-0.28, 0.07, 5e-4, -3e-4),
    "rational_polynomial": (-0.28, 0.09, 5e-4, -3e-4, 0.01, 1e-3, 0.0, 0.0),
    "thin_prism": (-0.28, 0.09, 5e-4, -3e-4, 0.01, 1e-3, 0.0, 0.0, 2e-3, 0.0, 1e-3, 0.0),
    "tilted": (-0.28, 0.09, 5e-4, -3e-4, 0.01, 1e-3, 0.0, 0.0, 2e-3, 0.0, 1e-3, 0.0, 0.01, 0.01),
    "equidistant": (),
}


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    points = random_cable(np.random.default_rng(4), 0.4)
    return points - [*points[1000, :2], 0.0]


@pytest.fixture(scope="module", params=LENSES)
def seen(request, tools, truth):
    """Three views, and in each whether the DLO is seen (H, W)."""
    name = request.param
    model = name if name in ("plumb_bob", "equidistant") else "rational_polynomial"
    lens = Intrinsics(640, 480, 600.0, 600.0, 319.5, 239.5, LENSES[name], model)
    rng = np.random.default_rng(9)
    scene = Scene3D((Cable3D(truth, RADIUS_M, (0.8, 0.1, 0.1)),), noise_texture(rng))
    matrix = [600.0, 0, 319.5, 0, 600.0, 239.5, 0, 0, 1]
    info = CameraInfo(width=640, height=480, K=matrix, D=LENSES[name], distortion_model=model)
    made, shown = [], []
    for x in (-0.03, 0.0, 0.03):
        camera = camera_above(np.array([x, 0.0]), 0.25, lens)
        rendered = render(scene, camera, rng)
        made.append(view(tools, rendered.rgb, camera).model_copy(update={"intrinsics": info}))
        shown.append(rendered.ids == 1)
    return made, shown


@pytest.fixture(scope="module")
def views(seen):
    return seen[0]


@pytest.mark.parametrize(("method", "limit_mm"), [("spline_bundle", 0.8), ("dlo3ds", 1.5)])
def test_the_curve_is_as_good_as_through_a_pinhole(tools, views, truth, method, limit_mm):
    """Every model but plumb_bob was an internal error."""
    result = stages.run(ReconstructRequest(views=views, method=method), tools).result
    assert 1000 * distances(np.array(result.curve.points_m), truth).mean() < limit_mm
    assert [v.status for v in result.views] == ["used"] * 3


def test_strokes_are_drawn_where_the_lens_shows_them(tools, seen, truth):
    stroke = Stroke(points_m=truth[::50].tolist(), thickness_m=2 * RADIUS_M)
    request = LabelTrackedRequest(views=seen[0], strokes=[stroke], files=["overlay"])
    for labels, shown in zip(stages.run(request, tools).result.views, seen[1], strict=True):
        x, y = np.rint(labels.instances[0].centerline_xy).astype(int).T
        assert shown[y, x].mean() > 0.98


def test_the_shorthand_of_a_fisheye_gives_what_the_message_gives(tools, views):
    info = views[0].intrinsics
    short = PinholeIntrinsics(
        width=640,
        height=480,
        fx=600.0,
        fy=600.0,
        cx=319.5,
        cy=239.5,
        distortion=info.D,
        distortion_model=info.distortion_model,
    )
    asked = [v.model_copy(update={"intrinsics": short}) for v in views]
    curves = [
        stages.run(ReconstructRequest(views=v, files=[]), tools).result.curve
        for v in (views, asked)
    ]
    assert curves[0] == curves[1]
