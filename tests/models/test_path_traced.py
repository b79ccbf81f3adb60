"""The path-traced renderer: labels that agree with its pictures. Needs the optional extra."""

from __future__ import annotations

import numpy as np
import pytest

from models.synthesis.path_traced import PathTracerMissingError, render_path_traced
from models.synthesis.scenes import Labelled, SceneParams
from models.synthesis.textures import load_pool

pytestmark = pytest.mark.no_cover  # of training and synthesis: nothing there is measured

PARAMS = SceneParams((96, 160), clutter=0.0, empty_share=0.0)


def render(seed: int) -> Labelled:
    return render_path_traced(np.random.default_rng(seed), PARAMS, load_pool(None), samples=2)


def installed() -> bool:
    try:
        import mitsuba  # noqa: F401
    except ImportError:
        return False
    return True


@pytest.mark.skipif(installed(), reason="mitsuba is installed")
def test_without_the_extra_it_says_what_to_install():
    with pytest.raises(PathTracerMissingError, match=r"photoreal\.in"):
        render(0)


needs_mitsuba = pytest.mark.skipif(
    not installed(), reason="needs mitsuba (requirements/photoreal.in)"
)


@needs_mitsuba
def test_equal_seeds_give_equal_pictures_and_labels():
    one, other = render(1), render(1)
    assert one.rgb.equal(other.rgb)
    assert one.ids.equal(other.ids)
    assert all(
        np.array_equal(a, b) for a, b in zip(one.centerlines, other.centerlines, strict=True)
    )


@needs_mitsuba
@pytest.mark.parametrize("seed", range(4))
def test_centerlines_lie_on_their_cables(seed):
    """A visible sample lies on its own id; most of each cable inside the picture is visible or
    under another."""
    scene = render(seed)
    ids = scene.ids.numpy()
    assert scene.ids.max() <= len(scene.centerlines)
    assert scene.rgb.shape == (3, 96, 160)
    for number, (curve, seen) in enumerate(
        zip(scene.centerlines, scene.visible, strict=True), start=1
    ):
        xy = np.rint(curve[:, :2]).astype(int)
        inside = ((xy >= 0) & (xy < (160, 96))).all(1)
        assert (ids[xy[seen, 1], xy[seen, 0]] == number).all()
        covered = ids[xy[inside, 1], xy[inside, 0]] > 0
        if inside.sum() > 20:
            assert covered.mean() > 0.9


@needs_mitsuba
def test_the_strand_on_top_owns_the_crossing():
    found = [(scene, c) for scene in map(render, range(8)) for c in scene.crossings]
    assert len(found) >= 5
    for scene, crossing in found:
        x, y = (round(v) for v in crossing.xy)
        assert crossing.visible == (int(scene.ids[y, x]) == crossing.over)
    assert np.mean([c.visible for _, c in found]) > 0.7
