"""A 3D curve, its uncertainty and the cameras as one SVG picture: from above and from the side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from dlo_client.contracts import Curve3D, Pose

_WIDTH = 960.0
_MARGIN = 48.0
_ELLIPSE = 14.0
"""About how long, in the picture, the ellipses are made."""
_Flat = tuple[float, float]
_Axis = tuple[int, float]
"""One of the world's axes, and 1 or -1 for its direction in the picture."""
_PLACES = ((0, 1, 2), (1, 3, 4), (2, 4, 5))
"""Where an entry of the covariance stands in a contract's six numbers."""


@dataclass(frozen=True)
class _Panel:
    """Maps two of the world's axes, in meters, to the picture: ``a`` to the right, ``b`` upward."""

    a: _Axis
    b: _Axis
    low: _Flat
    scale: float
    top: float
    height: float
    enlarged: int

    def at(self, point: Sequence[float]) -> _Flat:
        x = _MARGIN + (self.a[1] * point[self.a[0]] - self.low[0]) * self.scale
        return x, self.top + self.height - (self.b[1] * point[self.b[0]] - self.low[1]) * self.scale


def svg(curve: Curve3D, cameras: Sequence[Pose] = ()) -> str:
    """The curve from above and from the side, its longer direction to the right; two-sigma
    ellipses, enlarged so that they show; cameras as wedges."""
    everything = [*curve.points_m, *(tuple(row[3] for row in pose[:3]) for pose in cameras)]
    long, other = (0, 1) if _span(everything, 0) >= _span(everything, 1) else (1, 0)
    across: _Axis = (other, 1.0 if long == 0 else -1.0)  # no mirror: y to the right has x downward
    scale = (_WIDTH - 2 * _MARGIN) / _span(everything, long)
    enlarged = _enlarging(curve, scale)
    parts, top = [], 84.0
    for title, b in (("from above", across), ("from the side", (2, 1.0))):
        low = min(p[long] for p in everything), min(b[1] * p[b[0]] for p in everything)
        panel = _Panel((long, 1.0), b, low, scale, top, _span(everything, b[0]) * scale, enlarged)
        names = f"{'xyz'[long]} to the right, {'xyz'[b[0]]} {'up' if b[1] > 0 else 'down'}"
        parts.append(_text(_MARGIN, top - 12, f"{title} ({names})", "t"))
        parts += _drawn(curve, cameras, panel)
        top += panel.height + 64
    return _page(curve, scale, parts, top, enlarged)


def _enlarging(curve: Curve3D, scale: float) -> int:
    middle = sorted(curve.sigma_m)[len(curve.sigma_m) // 2]
    wanted = _ELLIPSE / max(2 * middle * scale, 1e-9)
    return max((n for n in (1, 2, 5, 10, 20, 50, 100, 200) if n <= wanted), default=1)


def _drawn(curve: Curve3D, cameras: Iterable[Pose], panel: _Panel) -> list[str]:
    (a, along), (b, up) = panel.a, panel.b
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(panel.at, curve.points_m))
    thick = max(2.0, 2 * (curve.radius_m or 0) * panel.scale)
    parts = [f'<polyline points="{path}" class="c" stroke-width="{thick:.1f}"/>']
    every = max(1, len(curve.points_m) // 40)
    for point, c in list(zip(curve.points_m, curve.covariance_m2, strict=True))[::every]:
        spread = (c[_PLACES[a][a]], -along * up * c[_PLACES[a][b]], c[_PLACES[b][b]])
        parts.append(_ellipse(panel.at(point), *spread, panel.scale * panel.enlarged))
    return parts + [_wedge(pose, panel) for pose in cameras]


def _wedge(pose: Pose, panel: _Panel) -> str:
    """The camera's center, and the edges of what it sees, 3 cm long."""
    corners = []
    for u, v in ((-0.5, -0.4), (0.5, -0.4), (0.5, 0.4), (-0.5, 0.4)):
        local = (0.03 * u, 0.03 * v, 0.03)
        corners.append(
            [row[3] + sum(r * x for r, x in zip(row, local, strict=False)) for row in pose[:3]]
        )
    center = panel.at([row[3] for row in pose[:3]])
    lines = [(center, panel.at(c)) for c in corners]
    lines += [
        (panel.at(c), panel.at(d)) for c, d in zip(corners, [*corners[1:], corners[0]], strict=True)
    ]
    path = " ".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in lines)
    return f'<path d="{path}" class="k"/>'


def _ellipse(at: _Flat, xx: float, xy: float, yy: float, scale: float) -> str:
    """Two standard deviations, enlarged, of a 2 × 2 covariance in the picture's axes."""
    mean, half = (xx + yy) / 2, (((xx - yy) / 2) ** 2 + xy**2) ** 0.5
    long, short = (max(mean + half, 0.0)) ** 0.5, (max(mean - half, 0.0)) ** 0.5
    dx, dy = (mean + half - yy, xy) if abs(mean + half - yy) > abs(xy) else (xy, mean + half - xx)
    size = (dx**2 + dy**2) ** 0.5
    cos, sin = (dx / size, dy / size) if size > 0 else (1.0, 0.0)
    rx, ry = (2 * scale * s for s in (long, short))
    matrix = f"{cos:.4f} {sin:.4f} {-sin:.4f} {cos:.4f} {at[0]:.1f} {at[1]:.1f}"
    return f'<ellipse rx="{rx:.1f}" ry="{ry:.1f}" transform="matrix({matrix})" class="u"/>'


def _page(curve: Curve3D, scale: float, parts: list[str], height: float, enlarged: int) -> str:
    radius = f", radius {1000 * curve.radius_m:.2f} mm" if curve.radius_m else ""
    sigma = 1000 * sum(curve.sigma_m) / len(curve.sigma_m)
    title = f"{curve.length_m:.3f} m{radius}, standard deviation {sigma:.2f} mm"
    note = f"ellipses: two standard deviations, {enlarged} times enlarged; bar: 0.1 m"
    style = (
        "text{font:14px system-ui,sans-serif;fill:#1b1f27}.h{font-weight:600;font-size:18px}.t{fill:#667085}"
        ".c{fill:none;stroke:#1f6fd6;stroke-linecap:round;stroke-linejoin:round}"
        ".u{fill:#f59e0b;fill-opacity:.35}.k{fill:none;stroke:#98a2b3}"
    )
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{_WIDTH:.0f}" height="{height:.0f}"><style>{style}</style>'
    ground = '<rect width="100%" height="100%" fill="#fff"/>'
    bar = f'<path d="M{_WIDTH - _MARGIN:.1f} 40h{-0.1 * scale:.1f}" stroke="#1b1f27" stroke-width="3"/>'
    words = [_text(_MARGIN, 30, title, "h"), _text(_MARGIN, 50, note, "t")]
    return "\n".join([head, ground, *words, bar, *parts, "</svg>"])


def _text(x: float, y: float, text: str, kind: str) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" class="{kind}">{escape(text)}</text>'


def _span(points: Sequence[Sequence[float]], axis: int) -> float:
    values = [p[axis] for p in points]
    return max(max(values) - min(values), 0.02)
