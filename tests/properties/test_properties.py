"""A few generated requests of every kind in each run, the same ones; ``python -m tests.properties``
tries thousands."""

from __future__ import annotations

import math
import os

import pytest
from hypothesis import HealthCheck, Phase, given, settings

from tests.properties.judging import Bench, check_finite
from tests.properties.requests import KINDS

pytestmark = pytest.mark.slow

COUNT = int(os.environ.get("PROPERTY_EXAMPLES", "10"))
FOLD = [[0.01 * (k % 2), 0.0] for k in range(16)]
LINE = [[0.03 * k, 0.0] for k in range(16)]
KNOTS = [0.0] * 4 + [1.0] * 4
CURVE = {
    "points_m": [[0, 0, 0], [0.5, 0, 0]],
    "covariance_m2": [[0] * 6] * 2,
    "sigma_m": [0, 0],
    "length_m": 0.5,
    "spline": {"degree": 3, "knots": KNOTS, "control_m": [[0.1 * k, 0, 0] for k in range(4)]},
}
LENS = {"width": 96, "height": 72, "fx": 100, "fy": 100, "cx": 48, "cy": 36}
CAMERA = {
    "intrinsics": LENS,
    "T_world_camera": [[1, 0, 0, 0.2], [0, -1, 0, 0], [0, 0, -1, 0.4], [0, 0, 0, 1]],
}
BRANCHES = [
    {"name": "a", "a": "p", "b": "q", "length": 1e-300},
    {"name": "b", "a": "q", "b": "r", "length": 1e9},
]
TWO = [CAMERA, CAMERA | {"T_world_camera": [[1, 0, 0, 0.3], *CAMERA["T_world_camera"][1:]]}]
VIEWS = [c | {"image": {"picture": f"slide{k}"}} for k, c in enumerate(TWO)]
FOLDED = [0.0764, 0.4764] * 5 + [0.0764]
FOUND = {
    "a length of 1e-300": (
        "plan_shape",
        {"state_m": FOLD, "target_m": LINE, "object": {"mass_kg": 0.05, "length_m": 1e-300}},
    ),
    "a fold": (
        "plan_shape",
        {"state_m": FOLD, "target_m": LINE, "object": {"mass_kg": 0.05, "length_m": 0.4}},
    ),
    "points a kilometer away": (
        "plan_shape",
        {
            "state_m": [[66.0, 364.0], [-866.0, -998.0]],
            "target_m": LINE,
            "object": {"mass_kg": 0.05},
        },
    ),
    "branches of 1e-300": (
        "topology",
        {"image": {"picture": "branch"}, "drawing": {"branches": BRANCHES}},
    ),
    "a focal length of 1e-300": (
        "next_view",
        {"curve": CURVE, "cameras": [CAMERA | {"intrinsics": LENS | {"fx": 1e-300}}]},
    ),
    "knots at one place": (
        "next_view",
        {"curve": CURVE | {"spline": CURVE["spline"] | {"knots": [0.5] * 8}}, "cameras": [CAMERA]},
    ),
    "a covariance of 1e300": (
        "merge_curves",
        {"curves": [CURVE | {"covariance_m2": [[1e300] * 6] * 2}]},
    ),
    "two kilometers in two points": (
        "merge_curves",
        {"curves": [CURVE | {"points_m": [[1000, 0, 0], [-999, -8, 0]]}], "spacing_m": 0.001},
    ),
    "coefficients of 1000": (
        "reconstruct",
        {
            "views": [
                v | {"intrinsics": LENS | {"distortion": [1e3, -1e3, 1e3, -1e3]}} for v in VIEWS
            ]
        },
    ),
    "a focal length of 1e-9": (
        "label_tracked",
        {
            "views": [VIEWS[0] | {"intrinsics": LENS | {"fy": 1e-9}}],
            "strokes": [{"points_m": [[0, 0, 0.3], [0.001, 0, 0.3]], "thickness_m": 1e-300}],
        },
    ),
    "a stroke ten kilometers away": (
        "label_tracked",
        {
            "views": [
                {
                    "intrinsics": {
                        "width": 96,
                        "height": 72,
                        "fx": 80,
                        "fy": 80,
                        "cx": 40,
                        "cy": 30,
                    },
                    "T_world_camera": [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.25], [0, 0, 0, 1]],
                    "image": {"picture": "cable"},
                }
            ],
            "strokes": [
                {"points_m": [[0.0024, 0, 10000], [0.2024, 0, 10000]], "thickness_m": 0.002}
            ],
            "T_world_tracker": [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0.25], [0, 0, 0, 1]],
            "correct": False,
            "measure_width": False,
        },
    ),
    "a rope folded upon itself": (
        "estimate_parameters",
        {
            "history": [
                {
                    "before": [[x, 3.4e-226] for x in FOLDED],
                    "after": [[x + 0.01, 0.01] for x in FOLDED],
                    "action": {"edge": 4, "dx_m": 0.0111, "dy_m": 0.05, "dtheta_rad": -0.0838},
                },
                {
                    "before": [[x, -0.0762] for x in (0.06, 0.46, 0.06, 0.46)],
                    "after": [[0, 0], [0.4, 0]],
                    "action": {"edge": 0, "dx_m": 0, "dy_m": 0, "dtheta_rad": 0},
                },
            ],
            "object": {"mass_kg": 0.02},
        },
    ),
    "a ring of a few pixels": (
        "instances",
        {
            "image": {"picture": "checker"},
            "method": "rt_dlo",
            "threshold": 0.5826186775714354,
            "params": {"sampling_ratio": 0.5826186775714354, "neighbors": 3},
        },
    ),
}
"""Each was an internal error, or ran into its time limit."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory) -> Bench:
    return Bench(tmp_path_factory.mktemp("data"))


@pytest.mark.parametrize("kind", KINDS)
def test_every_request_is_answered_or_refused_with_a_reason(bench, kind):
    """Never an internal error, never NaN, in bounded time and memory."""

    @settings(
        max_examples=COUNT,
        deadline=None,
        database=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(KINDS[kind])
    def one(request):
        assert bench.outcome(kind, request) in ("answered", "refused", "failed")

    one()


@pytest.mark.parametrize("name", FOUND)
def test_what_was_found_is_refused_or_answered(bench, name):
    bench.outcome(*FOUND[name])


def test_the_judge_finds_what_is_not_finite():
    with pytest.raises(AssertionError, match=r"result\.curve\.1"):
        check_finite({"curve": [0.0, math.nan]}, "result")
