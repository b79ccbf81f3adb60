"""Every kind of scene and of clutter is drawn, and its plate is in the documentation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from models.synthesis.kinds import LOOKALIKES, SCENES, lookalike_plate, scene_plate
from models.synthesis.textures import load_pool

pytestmark = pytest.mark.no_cover  # of training and synthesis: nothing there is measured

_PLATES = Path(__file__).parents[2] / "docs" / "images" / "kinds"


@pytest.mark.parametrize("name", [*SCENES, *LOOKALIKES])
def test_plate_is_in_the_documentation(name: str) -> None:
    assert (_PLATES / f"{name}.jpg").is_file()
    assert f"images/kinds/{name}.jpg" in (_PLATES.parents[1] / "renders.md").read_text()


@pytest.mark.slow
def test_plates_show_their_kind() -> None:
    pool = load_pool(None)
    thin, mat = scene_plate("thin_wires", pool), lookalike_plate("ruled_mat", pool)
    assert thin.shape == mat.shape == (216, 384, 3)
    assert np.ptp(mat.astype(int)) > 40
    assert (scene_plate("thin_wires", pool) == thin).all()
