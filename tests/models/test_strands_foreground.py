"""Foreground at the picture's edge: what runs along it is found whole and as wide as it is, what
leaves goes on."""

from __future__ import annotations

import numpy as np
import pytest

from models.instances import section_matching
from models.instances.published import ariadne_plus, fastdlo, rt_dlo
from models.strands.cleaning import clean
from models.strands.foreground import Foreground, distance_map, framed
from models.topology.extraction import extract
from tests.models.drawn_masks import drawn
from tests.models.harnesses import shipped

SHAPE = (180, 320)
METHODS = {
    m.__name__.rsplit(".", 1)[-1]: m.extract
    for m in (section_matching, rt_dlo, fastdlo, ariadne_plus)
}


def along(gap: int, width: int = 12, span: tuple[int, int] = (0, 320)) -> np.ndarray:
    """A bar beside the upper border; a negative gap is the part of it that is out of view."""
    mask = np.zeros(SHAPE, bool)
    mask[max(gap, 0) : gap + width, span[0] : span[1]] = True
    return mask


def turned(mask: np.ndarray, side: str) -> np.ndarray:
    turns = {"top": 0, "left": 1, "bottom": 2, "right": 3}
    return np.ascontiguousarray(np.rot90(mask, turns[side]))


def wave(center: float, amplitude: float) -> np.ndarray:
    x = np.linspace(-20, 340, 200)
    return drawn(np.stack((x, center + amplitude * np.sin(x / 40)), axis=1), width=12, shape=SHAPE)


ALONG = {
    **{f"{gap} px away": (along(gap), 12, 320) for gap in range(7)},
    **{f"at the {side}": (turned(along(0), side), 12, 320) for side in ("left", "bottom", "right")},
    "half out of view": (along(-6), 6, 320),
    "ends in view": (along(0, span=(60, 260)), 12, 200),
    "thin": (along(0, width=5), 5, 320),
    "leaves and comes back": (wave(6, 10), 12, 325),
    "touches twice": (wave(8, 6), 12, 325),
}


AROUND = (
    [[6, 200], [6, 6], [340, 6]],
    [[6, 200], [6, 6], [313, 6], [313, 200]],
    [[6, 6], [313, 6], [313, 173], [6, 173], [6, 6]],
)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("case", ALONG)
def test_a_cable_along_the_border_is_found_whole(name, case):
    """The picture's edge was no background: the default method and FASTDLO lost the cable, the
    others found it twice as wide as it is."""
    mask, width, length = ALONG[case]
    length = mask.shape[0] if mask.shape != SHAPE else length
    scene = METHODS[name](mask, None)
    (cable,) = scene.instances
    assert cable.width_px == pytest.approx(width, abs=2.1)
    assert cable.length_px == pytest.approx(length, rel=0.2 if name == "ariadne_plus" else 0.07)
    assert [e.kind for e in cable.endpoints] == ["border", "border"]


@pytest.mark.parametrize("case", ALONG)
def test_topology_finds_a_cable_along_the_border(case):
    """Every one of them was an empty answer, some because the slit to the border was filled like a
    hole."""
    mask, width, _ = ALONG[case]
    topology = extract(mask, *shipped())
    (section,) = topology.sections
    assert topology.status == "plain"
    assert section.width == pytest.approx(width, abs=2.1)
    assert section.ends == ("border", "border")


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("line", AROUND, ids=["one corner", "two corners", "ring"])
def test_a_cable_around_the_corners_is_one(name, line):
    """RT-DLO cut every path at a right angle; superpixels of Ariadne+, smaller than the cable is
    wide, forked there."""
    (cable,) = METHODS[name](drawn(np.array(line), width=12, shape=SHAPE), None).instances
    assert cable.width_px == pytest.approx(12, abs=1.5)
    assert cable.closed == (line[0] == line[-1])


def test_what_leaves_at_a_low_angle_goes_on_beyond_the_edge():
    """Taken as running along the border, its end was a wedge and lost."""
    for slope in (0.3, 0.5, 1.0):
        mask = drawn(np.array([[-40, -40 * slope], [300, 300 * slope]]), width=12, shape=SHAPE)
        beyond = framed(mask, 10)
        assert beyond[:10].any()
        assert beyond[10:-10, 10:-10].tolist() == mask.astype(int).tolist()


def test_outside_of_what_runs_along_the_edge_is_background():
    assert not framed(along(0), 10)[:10].any()
    assert distance_map(along(0)).max() == pytest.approx(6, abs=0.6)
    assert distance_map(turned(along(0), "right")).max() == pytest.approx(6, abs=0.6)


@pytest.mark.parametrize("shape", [(0, 7), (1, 1), (40, 30)])
def test_a_mask_without_background_has_no_distances(shape):
    assert not Foreground.of(np.ones(shape, bool)).distances.any()


def test_a_slab_goes_and_a_thick_cable_stays():
    """Thick cables were taken out like a slab, but for scraps of their outline."""
    shape = (360, 640)
    slab = np.zeros(shape, bool)
    slab[60:300, 200:440] = True
    assert not clean(slab, 0.7).mask.any()
    for width in (80, 120):
        cable = drawn(np.array([[40, 100], [320, 200], [600, 150]]), width=width, shape=shape)
        assert (clean(cable, 0.7).mask == cable).all()
