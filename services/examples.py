"""One request of every kind that works as it stands, for the documentation page and for a first
try.

The pictures are drawn (a blue cable on a speckled table, seen from three places) and come with the
service: their ids are known without an upload.
"""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parent / "samples"
_STEP_M = 0.03
"""Between the places the three pictures were taken from, along the camera's x axis."""

_LEFTMOST_M = (-0.06845, -0.00098, 0.3)
_INTRINSICS = {"width": 640, "height": 480, "fx": 600.0, "fy": 600.0, "cx": 319.5, "cy": 239.5}
_CABLE_M = [
    [-0.0723, -0.0890, 0.0323],
    [-0.0623, -0.0577, 0.0315],
    [-0.0504, -0.0272, 0.0289],
    [-0.0367, 0.0026, 0.0244],
    [-0.0214, 0.0316, 0.0187],
    [-0.0049, 0.0600, 0.0129],
    [0.0118, 0.0882, 0.0081],
]

PICTURES = {
    hashlib.sha256(data).hexdigest(): data
    for data in (path.read_bytes() for path in sorted(_FOLDER.glob("*.jpg")))
}
"""Of the examples, by the id under which the service knows them."""

_LABELS, _NETWORK = ((_FOLDER / name).read_bytes() for name in ("labels.zip", "brightness.dlonet"))
UPLOADS = {hashlib.sha256(data).hexdigest(): data for data in (_LABELS, _NETWORK)}
"""Six labelled pictures, and a network that takes what is bright for a cable."""


def _view(index: int) -> dict[str, Any]:
    x, y, z = _LEFTMOST_M
    pose = [
        [1.0, 0.0, 0.0, x + index * _STEP_M],
        [0.0, -1.0, 0.0, y],
        [0.0, 0.0, -1.0, z],
        [0.0, 0.0, 0.0, 1.0],
    ]
    return {"intrinsics": _INTRINSICS, "T_world_camera": pose}


def _picture(index: int) -> dict[str, str]:
    return {"id": list(PICTURES)[index]}


def _curve(start_m: float, end_m: float) -> dict[str, Any]:
    """A straight DLO along x."""
    points = [[start_m + (end_m - start_m) * k / 10, 0.0, 0.01] for k in range(11)]
    variance = 1e-6
    return {
        "points_m": points,
        "covariance_m2": [[variance, 0.0, 0.0, variance, 0.0, variance]] * len(points),
        "sigma_m": [1e-3] * len(points),
        "spline": {
            "degree": 3,
            "knots": [0.0] * 4 + [1.0] * 4,
            "control_m": [[start_m + (end_m - start_m) * k / 3, 0.0, 0.01] for k in range(4)],
        },
        "radius_m": 0.003,
        "length_m": end_m - start_m,
    }


_LINE_M = [[round(0.03 * k, 3), 0.0] for k in range(16)]
_BENT_M = [[round(0.03 * k, 3), round(0.0008 * max(0, k - 7) ** 2, 4)] for k in range(16)]
_LIFTED = {"edge": 12, "dx_m": 0.0, "dy_m": 0.03, "dtheta_rad": 0.2}
_CABLE = {"mass_kg": 0.05}

EXAMPLES: dict[str, dict[str, Any]] = {
    "instances": {"image": _picture(1)},
    "segment": {"image": _picture(1)},
    "topology": {"image": _picture(1)},
    "plan_disentangle": {
        "image": _picture(1),
        "arms": [{"name": "left", "xy": [-200, 240]}, {"name": "right", "xy": [840, 240]}],
    },
    "reconstruct": {"views": [_view(k) | {"image": _picture(k)} for k in range(3)]},
    "next_view": {"curve": _curve(-0.08, 0.08), "cameras": [_view(k) for k in range(3)]},
    "merge_curves": {"curves": [_curve(-0.1, 0.02), _curve(-0.02, 0.1)]},
    "label_tracked": {
        "views": [_view(k) | {"image": _picture(k)} for k in range(3)],
        "strokes": [{"points_m": _CABLE_M, "thickness_m": 0.0035, "name": "blue cable"}],
    },
    "plan_shape": {"state_m": _LINE_M, "target_m": _BENT_M, "object": _CABLE},
    "estimate_parameters": {
        "history": [{"before": _LINE_M, "action": _LIFTED, "after": _BENT_M}],
        "object": _CABLE,
    },
    "adapt": {
        "name": "drawn-table",
        "labels": {"id": hashlib.sha256(_LABELS).hexdigest()},
        "minutes": 1,
    },
    "import_network": {"name": "brightness", "file": {"id": hashlib.sha256(_NETWORK).hexdigest()}},
    "noop": {"hold_s": 0.5},
}
"""Fields of a request, by its kind."""


CAMERA: dict[str, Any] = {"intrinsics": _INTRINSICS, "T_world_camera": _view(1)["T_world_camera"]}
"""Body of a camera that took the picture of most examples."""

RECIPE: dict[str, Any] = {
    "name": "cables on the table",
    "request": {"kind": "instances", "files": []},
    "samples": [{"image": _picture(1)}],
}
"""Body of a recipe that works as it stands."""


def documented() -> dict[str, dict[str, Any]]:
    """As OpenAPI lists the examples of a body."""
    return {
        kind: {"summary": kind, "value": {"kind": kind, **fields}}
        for kind, fields in EXAMPLES.items()
    }
