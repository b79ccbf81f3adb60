"""The functions of `dlo` on arrays drawn by hand, and the errors for arrays that cannot be worked
with."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from models import library as dlo
from models.instances.methods import METHODS
from models.instances.settling import Settled
from models.library import perception

LINE = np.stack([np.linspace(0, 0.3, 12), np.zeros(12)], axis=1)
ARC = np.stack([np.linspace(0, 0.3, 12), 0.05 * np.sin(np.linspace(0, np.pi, 12))], axis=1)
INTRINSICS = dlo.Intrinsics(width=160, height=120, fx=200, fy=200, cx=80, cy=60)
CAMERA = dlo.Camera(INTRINSICS, np.eye(4))


def cross() -> np.ndarray:
    """A gray DLO from side to side, and a blue one from top to bottom over it."""
    picture = np.zeros((120, 160, 3), np.uint8)
    picture[55:65] = 200
    picture[:, 75:85] = (90, 90, 200)
    return picture


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_two_dlos_that_cross(method):
    scene = dlo.instances(cross(), cross().any(axis=2), method=method)
    assert len(scene.instances) == 2
    assert len(scene.crossings) == 1
    assert scene.crossings[0].xy == pytest.approx((80, 60), abs=6)


@pytest.mark.parametrize("dtype", [bool, np.uint8, np.int32, np.float32, np.float64])
def test_a_mask_of_any_type_means_the_same(dtype):
    mask = cross().any(axis=2).astype(dtype)
    assert len(dlo.instances(mask=mask).instances) == 2
    assert len(dlo.topology(mask=mask).crossings) == 1


def test_segment_gives_a_probability_for_every_pixel():
    found = dlo.segment(cross())
    assert found.probability.shape == found.mask.shape == (120, 160)
    assert 0 <= found.probability.min() <= found.probability.max() <= 1
    assert dlo.segment(cross(), threshold=0.0).threshold == 0.0


def test_instances_are_those_that_settled_the_foreground(monkeypatch):
    """They were extracted a second time, and rated by the settled foreground instead of the seen
    one."""
    settled = dlo.instances(mask=cross().any(axis=2))

    def settle(image, probability, cable, threshold):
        return Settled(cable, probability, settled)

    monkeypatch.setattr(perception, "settle", settle)
    assert dlo.instances(cross()) is settled
    assert dlo.instances(cross(), method="rt_dlo") is not settled


def test_a_crossing_of_a_topology_is_planned_for():
    actions = dlo.plan_disentangle(dlo.topology(cross(), cross().any(axis=2)))
    assert actions
    assert actions[0].after < actions[0].before == 1


def test_a_plan_brings_the_dlo_closer_and_is_in_meters():
    before = float(np.linalg.norm(LINE - ARC, axis=1).mean())
    actions = dlo.plan_shape(LINE, ARC, mass_kg=0.05, limits=dlo.Limits(shift=0.06))
    assert actions[0].error_m < 0.6 * before
    assert np.abs(actions[0].move[:2]).max() <= 0.06 + 1e-9
    assert actions[0].predicted_m.shape == LINE.shape
    assert all(actions[0].keeps.values())


def test_a_plan_for_a_dlo_ten_times_as_long_is_ten_times_as_large():
    """Beyond the trained lengths a DLO is planned for as one at their edge, scaled."""
    wide = dlo.Limits(shift=10.0)
    near = dlo.plan_shape(LINE / 0.6, ARC / 0.6, mass_kg=0.05, limits=wide)[0]
    far = dlo.plan_shape(LINE / 0.06, ARC / 0.06, mass_kg=0.05, limits=wide)[0]
    assert far.edge == near.edge
    assert far.move[:2] == pytest.approx(10 * near.move[:2], rel=0.05, abs=0.01)


def test_parameters_stay_at_mid_range_when_an_action_moved_nothing_else():
    found = dlo.estimate_parameters([LINE], [LINE], [3], [[0.0, 0.0, 0.0]], mass_kg=0.05)
    assert found.bending == pytest.approx(0.5, rel=0.3)
    assert found.error_m == pytest.approx([0.0], abs=1e-3)


def test_a_picture_without_a_dlo_is_not_reconstructed():
    pictures = [np.zeros((120, 160, 3), np.uint8)] * 2
    with pytest.raises(dlo.NotReconstructable, match="fewer than two pictures"):
        dlo.reconstruct(pictures, [CAMERA, CAMERA])


@pytest.mark.parametrize(
    ("call", "argument", "words"),
    [
        (lambda: dlo.segment(cross().astype(float)), "picture", "uint8"),
        (lambda: dlo.segment(cross()[:, :, 0]), "picture", "(height, width, 3)"),
        (lambda: dlo.segment(cross()[:0]), "picture", "empty"),
        (lambda: dlo.segment("photo.jpg"), "picture", "array of numbers"),
        (lambda: dlo.segment([[1], [1, 2]]), "picture", "not an array"),
        (lambda: dlo.segment(cross(), model="best"), "model", "foreground_compact"),
        (lambda: dlo.segment(cross(), threshold=2), "threshold", "0 to 1"),
        (lambda: dlo.instances(), "picture", "mask is needed"),
        (lambda: dlo.instances(cross(), cross()[:50, :, 0]), "mask", "160 × 50"),
        (lambda: dlo.instances(mask=cross()), "mask", "(height, width)"),
        (lambda: dlo.instances(mask=np.full((9, 9), np.nan)), "mask", "NaN"),
        (lambda: dlo.instances(mask=np.full((9, 9), 7.0)), "mask", "0 to 1"),
        (lambda: dlo.instances(mask=np.zeros((9, 9), complex)), "mask", "complex"),
        (lambda: dlo.instances(cross(), method="best"), "method", "section_matching"),
        (
            lambda: dlo.instances(cross(), params=dlo.RtDloParams()),
            "params",
            "SectionMatchingParams",
        ),
        (lambda: dlo.topology(cross(), depth_m=np.ones((9, 9))), "depth_m", "9 × 9"),
        (lambda: dlo.topology(cross(), depth_m=np.ones((120, 160), int)), "depth_m", "meters"),
        (lambda: dlo.plan_disentangle(cross()), "topology", "ndarray"),
        (lambda: dlo.plan_shape(LINE * np.nan, ARC, mass_kg=0.05), "state_m", "NaN"),
        (lambda: dlo.plan_shape(LINE, ARC[:1], mass_kg=0.05), "target_m", "at least 2"),
        (lambda: dlo.plan_shape(LINE * 0, ARC, mass_kg=0.05), "state_m", "no length"),
        (lambda: dlo.plan_shape(LINE * 1e9, ARC, mass_kg=0.05), "state_m", "beyond"),
        (lambda: dlo.plan_shape(LINE, ARC, mass_kg=5), "mass_kg", "0.02 to 0.1"),
        (lambda: dlo.plan_shape(LINE, ARC, mass_kg=0.05, horizon=9), "horizon", "1 to 4"),
        (
            lambda: dlo.estimate_parameters([LINE], [LINE], [40], [[0, 0, 0]], mass_kg=0.05),
            "edges[0]",
            "0 to 10",
        ),
        (
            lambda: dlo.estimate_parameters([LINE], [], [0], [[0, 0, 0]], mass_kg=0.05),
            "moves",
            "0 after_m",
        ),
        (lambda: dlo.reconstruct([cross()], [CAMERA]), "pictures", "2 to 16"),
        (lambda: dlo.reconstruct([cross()] * 2, [CAMERA]), "cameras", "1 for 2"),
        (lambda: dlo.reconstruct([cross()] * 2, [CAMERA, None]), "cameras[1]", "NoneType"),
        (lambda: dlo.reconstruct([cross(), cross()[:50]], [CAMERA] * 2), "cameras[1]", "160 × 50"),
        (lambda: dlo.label_tracked([cross()], [CAMERA], [LINE], [0.01]), "strokes_m[0]", "(n, 3)"),
        (lambda: dlo.label_tracked([cross()], [CAMERA], [], []), "thickness_m", "0 strokes"),
    ],
)
def test_what_cannot_be_worked_with_is_named(call, argument, words):
    with pytest.raises(dlo.ArgumentError) as raised:
        call()
    assert raised.value.argument == argument
    assert str(raised.value).startswith(argument)
    assert words in str(raised.value)


def test_everything_public_is_documented():
    """Each argument of a function is named in its docstring."""
    assert [name for name in dlo.__all__ if not (getattr(dlo, name, None) or "").__doc__] == []
    for name in (
        "segment",
        "instances",
        "topology",
        "reconstruct",
        "plan_shape",
        "estimate_parameters",
    ):
        function = getattr(dlo, name)
        missing = [
            p for p in inspect.signature(function).parameters if f"``{p}``" not in function.__doc__
        ]
        assert missing == [], (name, missing)
