"""A working request of each kind with its answer: `python -m tests.api_examples` writes
docs/api.md.

The tests send the same requests, so that a page that is no longer true fails.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from dlo_client.contracts import AnyRequest
from pydantic import TypeAdapter

from workers import stages
from workers.settings import Settings
from workers.stages.outcome import Tools

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "api.md"
_PICTURE = "tests/samples/busy.jpg"
_HARNESS = "docs/examples/harness.png"
_FROM_POSES = ("docs/examples/left.jpg", "docs/examples/middle.jpg", "docs/examples/right.jpg")
_MOST_ITEMS = 2
_MOST_TEXT = 40

_INTRINSICS = {"width": 480, "height": 360, "fx": 450, "fy": 450, "cx": 240, "cy": 180}
_ALONG = [
    [-0.0163, -0.11],
    [-0.0196, -0.066],
    [-0.0095, -0.022],
    [0.0095, 0.022],
    [0.0196, 0.066],
    [0.0163, 0.11],
]
_LINE = [[0.02 * k, 0.0] for k in range(16)]
_FIXTURES = [
    {"kind": "peg", "xy_m": [0.1, -0.03], "radius_m": 0.01},
    {"kind": "clip", "xy_m": [0.2, 0.02], "angle_rad": 0.3, "width_m": 0.012},
]
_ROUTE = {"stops": [{"fixture": 0, "side": "right"}, {"fixture": 1}], "slack_m": 0.02}
_ARC = [[0.02 * k, round(0.05 - 0.0009 * (k - 7.5) ** 2, 4)] for k in range(16)]


@dataclass(frozen=True)
class Example:
    """``images`` and ``mask``: files of the repository that go along; ``variant``: words behind the
    kind, where there are several of one kind."""

    request: dict[str, Any]
    what: str
    images: tuple[str, ...] = ()
    mask: str | None = None
    variant: str = ""

    @property
    def title(self) -> str:
        return f"`{self.kind}` {self.variant}".rstrip()

    @property
    def kind(self) -> str:
        return str(self.request["kind"])


def _view(x: float) -> dict[str, Any]:
    pose = [[1, 0, 0, x], [0, -1, 0, 0], [0, 0, -1, 0.25], [0, 0, 0, 1]]
    return {"intrinsics": _INTRINSICS, "T_world_camera": pose}


@cache
def _seen() -> tuple[Example, ...]:
    """What takes a picture or a mask alone."""
    ten_points = {"kind": "instances", "points_per_instance": 10}
    one_action = {"kind": "plan_disentangle", "at_most": 1}
    return (
        Example({"kind": "segment"}, "Foreground probability of a picture.", (_PICTURE,)),
        Example(ten_points, "The cables of a picture.", (_PICTURE,)),
        Example({"kind": "topology"}, "A wire harness in a mask.", mask=_HARNESS),
        Example(one_action, "How to remove its crossing.", mask=_HARNESS),
    )


def examples() -> tuple[Example, ...]:
    """In the order of the page; a curve that a request needs is that of the example before."""
    views = [_view(x) for x in (-0.03, 0.0, 0.03)]
    stroke = {"points_m": [[x, y, 0.008] for x, y in _ALONG], "thickness_m": 0.0036}
    moved = {
        "before": _LINE,
        "action": {"edge": 7, "dx_m": 0.0, "dy_m": 0.03, "dtheta_rad": 0.0},
        "after": _moved(),
    }
    looked = {"curve": _curve(-0.05, 0.05), "cameras": [views[0], views[2]]}
    shape = {"state_m": _LINE, "target_m": _ARC, "object": {"mass_kg": 0.05}}
    return (
        *_seen(),
        Example(
            {"kind": "reconstruct", "points": 20, "views": views}, "A cable in space.", _FROM_POSES
        ),
        Example({"kind": "next_view", **looked}, "Where to look from next."),
        Example(
            {"kind": "merge_curves", "curves": [_curve(-0.1, 0.02), _curve(-0.02, 0.1)]},
            "Sections to one.",
        ),
        Example(
            {"kind": "plan_shape", **shape}, "The action that brings a rope closest to a shape."
        ),
        Example(
            {
                "kind": "plan_shape",
                "state_m": _LINE,
                "object": shape["object"],
                "fixtures": _FIXTURES,
                "route": _ROUTE,
            },
            "The first action that brings a rope around a peg and into a clip.",
            variant="among fixtures",
        ),
        Example(
            {"kind": "estimate_parameters", "object": {"mass_kg": 0.05}, "history": [moved]},
            "What rope it is.",
        ),
        Example(
            {"kind": "label_tracked", "views": views, "strokes": [stroke]},
            "Labels of pictures.",
            _FROM_POSES,
        ),
        Example({"kind": "noop"}, "Nothing: the path of a job."),
    )


def _moved() -> list[list[float]]:
    return [[x, round(0.03 * max(0.0, 1 - abs(k - 7.5) / 6), 4)] for k, (x, _) in enumerate(_LINE)]


def _curve(begin: float, end: float) -> dict[str, Any]:
    """Straight along y, 2 mm thick, with a standard deviation of 1 mm upward and 0.2 mm
    sideways."""
    along = [round(begin + (end - begin) * k / 6, 4) for k in range(7)]
    thirds = [round(begin + (end - begin) * k / 3, 4) for k in range(4)]
    return {
        "points_m": [[0.0, y, 0.01] for y in along],
        "covariance_m2": [[4e-8, 0, 0, 0, 0, 1e-6]] * len(along),
        "sigma_m": [0.001] * len(along),
        "spline": {
            "degree": 3,
            "knots": [0, 0, 0, 0, 1, 1, 1, 1],
            "control_m": [[0.0, y, 0.01] for y in thirds],
        },
        "radius_m": 0.002,
        "radius_sigma_m": 0.0001,
        "length_m": round(end - begin, 4),
    }


def answers(tools: Tools) -> Iterator[tuple[Example, dict[str, Any], list[str]]]:
    """Each example with its result and the names of its files."""
    for example in examples():
        outcome = stages.run(_request(example, tools), tools)
        yield example, outcome.result.model_dump(mode="json"), sorted(outcome.files)


def _request(example: Example, tools: Tools) -> AnyRequest:
    """With its pictures stored, as the service fills them in."""
    ids = [{"id": tools.blobs.put((ROOT / name).read_bytes())} for name in example.images]
    values: dict[str, Any] = dict(example.request)
    if "views" in values and ids:
        values["views"] = [
            view | {"image": ref} for view, ref in zip(values["views"], ids, strict=True)
        ]
    elif ids:
        values["image"] = ids[0]
    if example.mask is not None:
        values["mask"] = {"id": tools.blobs.put((ROOT / example.mask).read_bytes())}
    request: AnyRequest = TypeAdapter(AnyRequest).validate_python(values)
    return request


def shortened(value: Any) -> Any:
    """Long lists and texts cut, with an ellipsis."""
    if isinstance(value, dict):
        return {name: shortened(item) for name, item in value.items()}
    if isinstance(value, list):
        kept = (
            value
            if all(not isinstance(v, (list, dict)) for v in value) and len(value) <= 4
            else value[:_MOST_ITEMS]
        )
        return [shortened(item) for item in kept] + (["…"] if len(value) > len(kept) else [])
    if isinstance(value, str) and len(value) > _MOST_TEXT and " " not in value:
        return value[: _MOST_TEXT // 2] + "…"
    return value


def command(example: Example) -> str:
    """For a shell in the repository's folder."""
    parts = [
        f"-F 'request={compact(example.request)}'",
        *(f"-F image=@{name}" for name in example.images),
    ]
    if example.mask is not None:
        parts.append(f"-F mask=@{example.mask}")
    return "curl " + " \\\n    ".join([*parts, "'http://127.0.0.1:8000/v1/jobs?wait=30'"])


def compact(value: Any, indent: int = 0, width: int = 100) -> str:
    """JSON with what fits on a line on one line."""
    line = json.dumps(value, ensure_ascii=False)
    if len(line) + indent <= width or not isinstance(value, (dict, list)):
        return line
    inner, outer = " " * (indent + 2), " " * indent
    if isinstance(value, dict):
        rows = [
            f"{inner}{json.dumps(k)}: {compact(v, indent + 2, width)}" for k, v in value.items()
        ]
        return "{\n" + ",\n".join(rows) + f"\n{outer}}}"
    return "[\n" + ",\n".join(inner + compact(v, indent + 2, width) for v in value) + f"\n{outer}]"


HEAD = """# The API by example

Written by `python -m tests.api_examples`; the tests send each request. The reference of every field is at `/docs` of a
running service. Start one with `make serve`, and run the commands in the repository's folder.

`POST /v1/jobs` takes a request as JSON (`application/json`), or as the part `request` of a form with its pictures
as parts `image`, `mask` and `depth`, which fill the fields left out, in order. Without `?wait=` the answer is 202
and the job's address; with it the answer is 200 and the job with its `result`, if it is done in time. Long lists
are cut here (`…`).

Pictures are PNG, JPEG, TIFF, WebP, BMP or GIF with 1 to 32 bits a sample; in a mask whatever is not background is
cable, be it 1, 2, white, red or opaque. How a picture was read where that may surprise (taken as a mask, further
pages, scaled) is in the answer's `warnings`.

Points are `(x, y)` in pixels of the upright picture; the center of the top-left pixel is `(0, 0)`.
`T_world_camera` takes the camera's frame (z forward, y down, meters) to the world. Every error is
`application/problem+json` and names the field.
"""


def page(tools: Tools) -> str:
    """The whole of docs/api.md."""
    parts = [HEAD]
    for example, result, files in answers(tools):
        stored = f"Files of the job: {', '.join(f'`{name}`' for name in files)}.\n" if files else ""
        parts.append(
            f"## {example.title}\n\n{example.what}\n\n```\n{command(example)}\n```\n\n"
            f"Its `result`:\n\n```\n{compact(shortened(result))}\n```\n{stored and chr(10)}{stored}"
        )
    return "\n".join(parts)


def outline(value: Any) -> Any:
    """What must not change of an answer: names and types, not numbers. Of a list its first item
    counts."""
    if isinstance(value, dict):
        return {name: outline(item) for name, item in value.items()}
    if isinstance(value, list):
        return [outline(value[0])] if value else []
    return (
        "number"
        if isinstance(value, (int, float)) and not isinstance(value, bool)
        else type(value).__name__
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        PAGE.write_text(page(stages.warm(Settings(data_dir=Path(folder), onnx_threads=1))))
