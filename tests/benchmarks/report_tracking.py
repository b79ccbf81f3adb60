"""The sections of RESULTS.md about tracking and depth."""

from __future__ import annotations

from typing import Any

from tests.benchmarks.markdown import table


def tracking(data: dict[str, Any]) -> str:
    rows = [
        [kind, method, *_spread(scores, "idf1"), *_spread(scores, "switches")]
        for kind, methods in data["sets"].items()
        for method, scores in methods.items()
    ]
    ours = {kind: methods["ours"] for kind, methods in data["sets"].items()}
    own = [
        [
            kind,
            *_spread(m, "drift_widths"),
            _right(m) if kind == "covered" else "–",
            m["ms"],
            m["instances_ms"],
        ]
        for kind, m in ours.items()
    ]
    seeds = ", ".join(
        f"{clips} of `{kind}` ({first}, {number}, 0 to {clips - 1})"
        for kind, (first, number, clips) in data["seeds"].items()
    )
    return (
        "## Tracking\n\n`python -m tests.benchmarks.bench_tracking`: rendered clips, four cables of one look that "
        f"drift, turn and bend; clips of {data['frames']} frames, with their seeds: {seeds}. `fast`: three "
        "times the speed; `covered`: an arm lies over a good part of the picture for a while; `hidden`: no cable is "
        "seen for ten frames; `ropes`: dragged in MuJoCo. True masks, the default method's instances. A cable is found "
        "where F1 of its points in view is above one half. Switches as CLEAR MOT counts them: a cable is found with "
        "another id than the last time; an id that is still on it is kept. ±: standard deviation between clips. "
        "Floors: IDF1 90 and one switch a clip; 85 % right after cover; drift 2 widths; 8 ms a frame beside the "
        "instances.\n\n"
        + table(["set", "method", "IDF1", "worst clip", "switches a clip", "worst clip"], rows)
        + "\n"
        + table(
            [
                "set",
                "drift, widths",
                "worst clip",
                "right after cover %",
                "ms a frame",
                "instances, ms",
            ],
            own,
        )
        + "\n"
        + _stress(data.get("stress", {}))
        + _labels(data.get("labels", []))
    )


def _stress(data: dict[str, dict[str, dict[str, float]]]) -> str:
    if not data:
        return ""
    rows = [
        [
            _STRESSED[name],
            value,
            *_spread(m, "idf1"),
            *_spread(m, "switches"),
            f"{m['drift_widths']:.2f}",
            "–" if name == "speed" else _right(m),
        ]
        for name, values in data.items()
        for value, m in values.items()
    ]
    columns = [
        "IDF1",
        "worst clip",
        "switches a clip",
        "worst clip",
        "drift, widths",
        "right after cover %",
    ]
    return (
        "\nMade harder, the same cables each time (the first two clips of `moving` and of `covered`):\n\n"
        + table(["what", "how much", *columns], rows)
    )


_STRESSED = {
    "speed": "speed, widths a frame at most",
    "share": "share covered for 30 frames",
    "hidden": "frames in which nothing is seen",
}


def _spread(scores: dict[str, float], name: str) -> tuple[str, float]:
    """Mean and standard deviation, and the worst."""
    return f"{scores[name]:.2f} ± {scores[f'{name}_sd']:.2f}", scores[f"{name}_worst"]


def _right(scores: dict[str, float]) -> str:
    return "{:.1f} ± {:.1f}".format(
        *(100 * scores[f"right_after_cover{end}"] for end in ("", "_sd"))
    )


def _labels(clips: list[dict[str, float]]) -> str:
    if not clips:
        return ""
    rows = [[k, *(clip[name] for name in _LABELS)] for k, clip in enumerate(clips)]
    mean = ["mean", *(round(sum(clip[name] for clip in clips) / len(clips), 1) for name in _LABELS)]
    return (
        "\nOne labelled frame of `moving`, propagated to the next 100 as `dlo label VIDEO` does it: IoU of each "
        "cable's mask, %, where at least 30 % of it are in view; floor 85.\n\n"
        + table(["clip", *_LABELS.values()], [*rows, mean])
    )


_LABELS = {"iou": "mean IoU", "last": "mean IoU, last ten frames"}


def depth(data: dict[str, Any]) -> str:
    names = {
        "error": "centerline error, mm, mean",
        "error_p90": "the same, 90th percentile",
        "raw": "baseline: depth of the pixel, mm, mean",
        "inside": "stated 90 % ellipses cover (share)",
        "astray": "points of instances that went on along another cable, left out above (share)",
        "radius": "radius, error as a share",
        "order": "order at crossings right (share)",
        "dice": "foreground by height alone, Dice",
        "table_deg": "table, degrees off",
        "table_mm": "table, mm off",
        "ms": "ms a cable",
    }
    return (
        f"## Depth\n\n`python -m tests.benchmarks.bench_depth`: {data['scenes']} scenes{_unseen(data)} of three "
        f"cables of 3.5 mm on a table at 0.6 m, noise {data['sigma_mm']} mm alike in neighboring pixels, holes, flying "
        f"pixels; true masks; {data['points']} points, {data['crossings']} crossings. Floors: error 1.5 mm, "
        "cover 0.85 to 0.95.\n\n"
        + table(
            ["measured", ""], [[text, data[name]] for name, text in names.items() if name in data]
        )
    )


def _unseen(data: dict[str, Any]) -> str:
    return "" if data.get("tuning", True) else " that no constant was chosen on,"


def harness_depth(data: dict[str, Any]) -> str:
    names = {
        "branch_f1": "branch-points F1",
        "crossing_f1": "crossings F1",
        "counts_right": "both counts right (share)",
        "dice": "foreground Dice",
        "shadow_taken": "share of the shadows taken for cables",
    }
    rows = [[way, *(scores[name] for name in names)] for way, scores in data["ways"].items()]
    return (
        f"## Harnesses in color and depth\n\n`python -m tests.benchmarks.bench_harness_depth`: {data['scenes']} "
        f"rendered harnesses of one or two branch-points (thesis 6.5.1) with the shadows of a lamp, depth noise "
        f"{data['sigma_mm']} mm alike in neighboring pixels, holes, flying pixels; through the service's stage. Floors "
        "with color and depth: branch-points 0.93, crossings 0.95.\n\n"
        + table(["from", *names.values()], rows)
    )


SECTIONS = {"tracking": tracking, "depth": depth, "harness_depth": harness_depth}
