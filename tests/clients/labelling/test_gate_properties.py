"""Whatever stands in a file, a reader ends with labels, with problems, or with a FormatError."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dlo_client.labelling.formats import FormatError, Imported
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.clients.labelling import drawn
from tests.clients.labelling.foreign import SQUARE, coco, cvat, read, region, shape, task

pytestmark = pytest.mark.slow
SETTINGS = settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
PLAIN = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**40), 10**40),
    st.floats(),
    st.text(max_size=8),
    st.floats(-20, 120),
)
ANYTHING = st.recursive(
    PLAIN,
    lambda x: st.lists(x, max_size=5) | st.dictionaries(st.text(max_size=6), x, max_size=4),
    max_leaves=8,
)
NUMBER = st.one_of(
    st.floats(),
    st.floats(-200, 300),
    st.integers(-300, 300),
    st.sampled_from([1e9, 1e308, 0.0, -0.0, 1e-300]),
)
POINTS = st.lists(st.lists(NUMBER, min_size=2, max_size=2), max_size=8)


def imported(tool: str, content: object) -> Imported | None:
    with tempfile.TemporaryDirectory() as folder:
        try:
            return read(tool, Path(folder), content)
        except FormatError:
            return None


def sound(found: Imported | None, *, good: str | None = None) -> None:
    """No instance without pixels, no number that is none, ids told apart; the good picture is
    there."""
    if found is None:
        return
    for label in found.labels:
        assert len({item.id for item in label.instances}) == len(label.instances)
        for item in label.instances:
            assert drawn.mask(item).any()
            assert np.isfinite(np.asarray(item.centerline_xy, float)).all()
            assert 0 < item.width_px < 1e5
    if good is not None:
        assert [label for label in found.labels if label.name == good]


@SETTINGS
@given(st.lists(POINTS, max_size=3), POINTS, PLAIN, PLAIN)
def test_polygons_and_lines_of_any_numbers(
    rings: list[Any], line: list[Any], width: Any, number: Any
) -> None:
    flat = [[value for point in ring for value in point] for ring in rings]
    wild = {"segmentation": flat, "centerline_xy": line, "width_px": width, "instance": number}
    sound(imported("coco", coco([wild, {}], [{}])), good="1.png")
    facts = {
        "width_px": str(width).replace("<", "").replace("&", "").replace("\x00", ""),
        "closed": "true",
    }
    facts = {k: "".join(c for c in v if c.isprintable()) for k, v in facts.items()}
    shapes = "".join(shape(tag, ring, facts) for ring in rings for tag in ("polygon", "polyline"))
    sound(imported("cvat", cvat(shapes, shape("polygon", SQUARE))), good="1.png")
    regions = [
        region("polygonlabels", {"points": ring}, id=f"p{k}") for k, ring in enumerate(rings)
    ]
    vertices = [{"x": x, "y": y} for x, y in line]
    regions.append(
        region(
            "vectorlabels", {"vertices": vertices}, meta={"width_px": width}, image_rotation=number
        )
    )
    good = region("polygonlabels", {"points": SQUARE})
    sound(imported("label-studio", [task("0.png", *regions), task("1.png", good)]), good="1.png")


@SETTINGS
@given(
    st.dictionaries(
        st.sampled_from(
            [
                "segmentation",
                "centerline_xy",
                "width_px",
                "instance",
                "iscrowd",
                "closed",
                "category_id",
                "image_id",
                "id",
            ]
        ),
        ANYTHING,
    ),
    ANYTHING,
)
def test_coco_of_any_types(annotation: dict[str, Any], crossings: Any) -> None:
    content = coco([annotation], [{}])
    content["images"][0]["crossings"] = crossings
    sound(imported("coco", content))


@SETTINGS
@given(ANYTHING, ANYTHING, ANYTHING, ANYTHING)
def test_any_json_at_all(images: Any, annotations: Any, categories: Any, whole: Any) -> None:
    sound(
        imported("coco", {"images": images, "annotations": annotations, "categories": categories})
    )
    sound(imported("coco", json.dumps(whole)))
    sound(imported("json", json.dumps(whole)))
    sound(imported("label-studio", json.dumps(whole)))


@SETTINGS
@given(
    ANYTHING,
    ANYTHING,
    ANYTHING,
    st.sampled_from(["brushlabels", "polygonlabels", "vectorlabels", "labels", "x"]),
)
def test_label_studio_of_any_types(value: Any, meta: Any, more: Any, kind: str) -> None:
    wild = region(
        kind,
        value if isinstance(value, dict) else {"rle": value, "points": value, "vertices": value},
    )
    wild["meta"] = meta
    extra = more if isinstance(more, dict) else {"result": more}
    sound(
        imported(
            "label-studio",
            [task("0.png", wild, meta=meta), task("1.png") | {"annotations": [extra, more]}],
        )
    )


@SETTINGS
@given(
    st.lists(st.integers(-(2**40), 2**40) | st.floats() | st.text(max_size=3), max_size=12),
    st.text(max_size=40),
)
def test_run_lengths_of_any_numbers(counts: list[Any], text: str) -> None:
    size = [drawn.HEIGHT, drawn.WIDTH]
    wild = [{"segmentation": {"size": size, "counts": given}} for given in (counts, text)]
    sound(imported("coco", coco(*([each] for each in wild), [{}])), good="2.png")
    rle = ", ".join("".join(c for c in str(v) if c.isalnum() or c in "-.") for v in counts)
    mask = f'<mask label="dlo" rle="{rle}" left="1" top="1" width="4" height="3"/>'
    sound(imported("cvat", cvat(mask, shape("polygon", SQUARE))), good="1.png")
    brush = region("brushlabels", {"rle": counts, "format": "rle"})
    sound(imported("label-studio", [task("0.png", brush)]))


@SETTINGS
@given(st.binary(max_size=200))
def test_any_bytes_at_all(content: bytes) -> None:
    from dlo_client.labelling.formats import READERS

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "export"
        file.write_bytes(content)
        for reader in READERS.values():
            try:
                sound(reader(file))
            except FormatError:
                continue
