"""The sections of RESULTS.md on all instance methods."""

from __future__ import annotations

from typing import Any

KEYS = ("iou", "iou_strict", "pq", "count", "crossings_found", "order_right", "ms", "ms_p95")
_FLOORS = """Floors on `ewd`: RT-DLO IoU 79.0, FASTDLO 76.0, Ariadne+ 75.0; `section_matching` (our own) IoU 81.0,
PQ 78, count 86 %, with holes IoU 74 and count 70 %, eroded twice IoU 66, crossings found 90 %, order right 95 %; on
`sbhc` closed and gray count 97 %; calibration error 0.08. Aims: 82.5 / 81 / 93, 79 / 86, 73, 96 / 98.5, 100, 0.03."""


def methods_section(data: dict[str, Any]) -> str:
    """Quality by method and mask, confidence, parameters, stages."""
    rows = [
        [name, wear, *(scores[k] for k in KEYS)]
        for name, by in data["ewd"].items()
        for wear, scores in by.items()
    ]
    rows += [[name, "sbhc", *(scores[k] for k in KEYS)] for name, scores in data["sbhc"].items()]
    rows += [
        [name, "sbhc closed gray", *(s[k] for k in KEYS)]
        for name, s in data["sbhc_closed_gray"].items()
    ]
    parts = [
        "## Instance methods on the same masks\n\n`python -m tests.benchmarks.bench_methods`; its head says how the "
        f"masks are worn. {_FLOORS}\n\n" + _table(["method", "masks", *KEYS], rows),
        "\nCalibration of the instances' scores on `ewd` (fitted on rendered scenes alone):\n\n"
        + _table(
            ["method", "instances", "error", "[count, stated, right] by tenth"],
            [[n, c["instances"], c["error"], c["curve"]] for n, c in data["calibration"].items()],
        ),
        "\nStages, median ms (wall clock):\n\n"
        + _table(
            ["method", "stages"],
            [[n, ", ".join(f"{k} {v}" for k, v in s.items())] for n, s in data["stages"].items()],
        ),
        "\nTen worst of each by strict IoU, and what is wrong there:\n\n"
        + _table(
            ["method and set", "picture", "IoU", "why"],
            [[name, *worst] for name, ten in data["worst"].items() for worst in ten],
        ),
    ]
    if "rt_dlo_parameters" in data:
        parts.append(
            "\nRT-DLO, IoU by `neighbors sampling_ratio` (Table 3.5): "
            + ", ".join(f"{k}: {v}" for k, v in data["rt_dlo_parameters"].items())
            + ".\n\nAriadne+, IoU by superpixels (Fig. 3.23): "
            + ", ".join(f"{k}: {v}" for k, v in data["ariadne_superpixels"].items())
            + ".\n"
        )
    return "".join(parts)


def masks_section(data: dict[str, Any]) -> str:
    """The methods on masks of several kinds, and by the number of crossings."""
    header = ["method", "masks", "eroded", "iou", "iou_strict", "pq", "count", "ms"]
    crossed = [
        [
            r["method"],
            r["crossings"],
            r["pictures"],
            r["iou"],
            r["ms"],
            ", ".join(f"{part} {ms}" for part, ms in r["stages"].items()),
        ]
        for r in data["methods"]
    ]
    counts = sorted({r["superpixels"] for r in data["superpixels"]})
    numbers = sorted({r["crossings"] for r in data["superpixels"]})
    found = {(r["crossings"], r["superpixels"]): r["iou"] for r in data["superpixels"]}
    return (
        "## Instance methods by mask and by crossings\n\n`python -m tests.benchmarks.bench_masks`, `ewd`. As Table 3.1 "
        "and Fig. 3.19 for both published backbones; in place of the salient-object networks of Figs. 3.21 and 3.22 "
        "our network at its fast setting and a rule without any.\n\n"
        + _table(header, [[r[key.split()[0]] for key in header] for r in data["masks"]])
        + "\nBy the number of true crossings (3: three and more; as Tables 3.3 and 3.4), median ms of one thread:\n\n"
        + _table(["method", "crossings", "pictures", "iou", "ms", "stages"], crossed)
        + "\nAriadne+, IoU by superpixels and crossings (Fig. 3.23):\n\n"
        + _table(
            ["crossings", *map(str, counts)], [[n, *(found[n, c] for c in counts)] for n in numbers]
        )
    )


def before_section(data: dict[str, Any]) -> str:
    """The default method's time beside that of an earlier commit."""
    return (
        "## The default method against the first release\n\n`python -m tests.benchmarks.bench_before SHARED`: the "
        f"{data['pictures']} pictures of `ewd` with their published masks, one thread, processor ms a picture, both "
        f"trees (`{data['commit']}` and this one) in turn. Floor: 0.8 times as long, aim 0.45.\n\n"
        + _table(
            ["before", "now", "ratio of each round", "median"],
            [
                [
                    data["before_ms"],
                    data["now_ms"],
                    ", ".join(map(str, data["ratios"])),
                    data["ratio"],
                ]
            ],
        )
    )


def tangles_section(data: dict[str, Any]) -> str:
    """Share of rendered scenes whose whole crossing sequence is right."""
    rows = [[r["crossings"], r["scenes"], r["sequence"], r["order"]] for r in data["rows"]]
    return (
        f"## Tangles of one color: {data['method']}\n\n`python -m tests.benchmarks.bench_tangles`. Aim: 80 % at 30 "
        "crossings. Rules were settled on scenes of another seed.\n\n"
        + _table(["crossings", "scenes", "sequence right %", "order right as well %"], rows)
    )


def _table(header: list[str], rows: list[list[Any]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"
