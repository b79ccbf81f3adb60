"""The section on the 3D reconstruction."""

from __future__ import annotations

from typing import Any

from tests.benchmarks.markdown import table

_COMMAND = "python -m tests.benchmarks.bench_reconstruction"
_ERRORS = ("error_mm", "p95_mm", "stated_mm", "coverage", "reprojection_px")


def section(data: dict[str, Any]) -> str:
    parts = [_head(data)]
    for name, write in _PARTS.items():
        parts.append(write(data[name]) if name in data else f"### {name}\n\nNot run.\n")
    return "\n".join(parts)


def _head(data: dict[str, Any]) -> str:
    return (
        f"## 3D reconstruction\n\n`{_COMMAND}`: rendered cables with exact truth (thesis section 4.6.1), 640 × 480, "
        "f = 600 px, camera 0.25 m over the table, 25 mm from one view to the next where nothing else is said. "
        "Errors are distances of the estimated points to the true curve.\n\n"
        + table(["asked", "floor", "aim", "published", "measured"], _asked(data))
    )


def _asked(data: dict[str, Any]) -> list[list[Any]]:
    """Every figure of the issue, with what is measured; a dash where its part has not run."""
    get = _Getter(data)
    gain = get.relative("sections", "optimised bz", "diameter 3.5 mm")
    return [
        [
            "thesis protocol, whole cables, mean error mm",
            0.82,
            0.41,
            0.821,
            get("scans", "b + z", "error_mm"),
        ],
        ["… reprojection px", 0.73, 0.45, 0.731, get("scans", "b + z", "reprojection_px")],
        [
            "… one section, fixed poses, mean error mm",
            "",
            "",
            "",
            get("sections", "diameter 3.5 mm", "error_mm"),
        ],
        [
            "error / (Z²σ/(f·b)), exact centerlines, 0.5 px",
            1.0,
            0.6,
            "",
            get("exact", "spline_bundle", "in_units"),
        ],
        ["baseline and distance optimised against fixed", "−25 %", "−35 %", "−29 %", gain],
        [
            "matching and triangulation, 3 views, 20 points, ms",
            15,
            5,
            "93–148",
            get("timings", "matching and triangulation, 20 points", "median_ms"),
        ],
        *_followed(get),
    ]


def _followed(get: _Getter) -> list[list[Any]]:
    """Which cable is which, and what is stated of the uncertainty."""
    return [
        [
            "five crossing cables of one color followed, centerlines with noise",
            0.95,
            0.99,
            "",
            get("identical", "exact centerlines, 0.5 px noise", "share"),
        ],
        ["… from pictures", 0.95, 0.99, "", get("identical", "pictures", "share")],
        [
            "90 % ellipsoids cover, pictures",
            "0.85–0.95",
            "0.88–0.92",
            "",
            get("sections", "diameter 3.5 mm", "coverage"),
        ],
        ["… all sections above", "", "", "", get.mean("sections", "coverage")],
        ["… exact centerlines with noise", "", "", "", get("exact", "spline_bundle", "coverage")],
    ]


class _Getter:
    def __init__(self, data: dict[str, Any]) -> None:
        self._data = data

    def __call__(self, part: str, row: str, value: str) -> Any:
        return self._data.get(part, {}).get(row, {}).get(value, "–")

    def relative(self, part: str, row: str, base: str) -> str:
        new, old = (self(part, r, "error_mm") for r in (row, base))
        return "–" if "–" in (new, old) else f"{100 * (new / old - 1):.0f} %"

    def mean(self, part: str, value: str) -> Any:
        values = [row[value] for name, row in self._data.get(part, {}).items() if name != "dlo3ds"]
        return round(sum(values) / len(values), 3) if values else "–"


def _rows(values: dict[str, dict[str, Any]], columns: tuple[str, ...]) -> str:
    return table(
        ["", *columns], [[name, *(row.get(c, "") for c in columns)] for name, row in values.items()]
    )


def _exact(part: dict[str, Any]) -> str:
    return "### Exact centerlines with 0.5 px of noise, in units of Z²σ/(f·b)\n\n" + _rows(
        part, ("in_units", "error_mm", "stated_mm", "coverage")
    )


def _sections(part: dict[str, Any]) -> str:
    return (
        "### One section, pictures to curve\n\nTen cables; `optimised` is a second look from the poses of `next_view` "
        "(not nearer than 0.15 m, baseline up to 0.15 m).\n\n"
        + _rows(part, (*_ERRORS, "radius_off"))
    )


def _scans(part: dict[str, Any]) -> str:
    columns = (
        "n",
        "error_mm",
        "q1_mm",
        "q3_mm",
        "missing_mm",
        "reprojection_px",
        "sections",
        "failed",
        "whole",
        "thicker",
    )
    return (
        "### Whole cables of 0.8 m with `Scan`\n\nOne parameter at a time around the defaults of section 4.6.1 (3.5 "
        "mm, 3 views, 50 % overlap). `q1_mm`, `q3_mm`: quartiles over all points (Fig. 4.7); `missing_mm`: mean "
        "distance of the true curve's points to the estimate; `failed`: scans that ended with an error; `whole`: "
        "cables followed from end to end; `thicker`: by which share they are measured too thick, the median of their "
        "sections.\n\n" + _rows(part, columns)
    )


def _identical(part: dict[str, Any]) -> str:
    return (
        "### Five crossing cables of one color\n\nEvery cable is the target once, named by a pixel. Right: nine tenths "
        "of the reprojection within 3 px of it in every view; placed: nine tenths of the points within 3 mm or three "
        "stated standard deviations of it in space; covered: share of its length in the reference picture that is "
        "followed (the curve ends where no view tells which of two DLOs goes on). A DLO that is joined wrongly counts "
        "as wrong.\n\n" + _rows(part, ("asked", "right", "share", "placed", "refused", "covered"))
    )


def _rigs(part: dict[str, Any]) -> str:
    return "### Other camera poses\n\n`dlo3ds_fails`: refused, or more than 5 mm off.\n\n" + _rows(
        part, ("n", "error_mm", "stated_mm", "coverage", "dlo3ds_fails")
    )


def _stereo(part: dict[str, Any]) -> str:
    return (
        "### Against semi-global matching (Fig. 4.8)\n\nAbsolute error of depth on the cable's pixels; `answered`: "
        "share of them with a depth at all.\n\n" + _rows(part, ("median_mm", "p90_mm", "answered"))
    )


def _timings(part: dict[str, Any]) -> str:
    return "### Processor time of one thread, ms\n\n" + _rows(part, ("best_ms", "median_ms"))


_PARTS = {
    "exact": _exact,
    "sections": _sections,
    "scans": _scans,
    "identical": _identical,
    "rigs": _rigs,
    "stereo": _stereo,
    "timings": _timings,
}
