"""RESULTS.md from the JSON of the benchmarks: what was measured, beside what was asked for."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from tests.benchmarks import (
    report_labelling,
    report_planner,
    report_reconstruction,
    report_topology,
    report_tracking,
    report_training,
)
from tests.benchmarks.markdown import table as _table
from tests.benchmarks.report_adaptation import adaptation, reference
from tests.benchmarks.report_methods import (
    before_section,
    masks_section,
    methods_section,
    tangles_section,
)
from tests.benchmarks.report_photographs import photographs
from tests.benchmarks.report_plant import (
    bridge_section,
    faults_section,
    fuzz_section,
    hosts_section,
    large_section,
    load_section,
    plant_section,
    properties_section,
    throughput_section,
)

HEAD = """# Measured

Written by `make bench` from the JSON that each benchmark leaves in `build/bench`. The real photographs are for
measuring only: nothing is trained on them. They are the development part of each set; the rules and limits of
RT-DLO and of `section_matching` were chosen while looking at `ewd` (RT-DLO at `sbhc` too), so pictures kept aside may
score lower. Times are from a
machine with two shared cores: compare them within a run.
"""


def write_report(folder: Path, target: Path) -> None:
    """Read what ``folder`` holds and write ``target``; a benchmark that has not run there keeps its
    section, or is named as not run."""
    kept = _sections(target.read_text()) if target.exists() else {}
    parts = [HEAD]
    for name, section in SECTIONS.items():
        file = folder / f"{name}.json"
        text = (
            section(json.loads(file.read_text()))
            if file.exists()
            else kept.get(name, f"## {name}\n\nNot run.\n")
        )
        parts.append(f"<!-- {name} -->\n{text}")
    target.write_text("\n".join(parts))


def _sections(report: str) -> dict[str, str]:
    """The sections of an earlier report by the names in their marks."""
    _, *parts = re.split(r"^<!-- (\w+) -->\n", report, flags=re.MULTILINE)
    return {
        name: text.rstrip("\n") + "\n" for name, text in zip(parts[::2], parts[1::2], strict=True)
    }


def _http(data: dict) -> str:
    rows = [[kind, part["jobs"], part["p50_ms"], part["p95_ms"]] for kind, part in data.items()]
    return (
        "## Over HTTP\n\n`python -m tests.benchmarks.bench_http`: jobs with `?wait=10`, one after the other, both "
        "kinds in turn, one warm worker on two cores: no-ops, and a photograph of 640 × 360 px to the JSON of its "
        "instances. Floors for p50: 15 ms and 60 ms.\n\n"
        + _table(["kind", "jobs", "p50 ms", "p95 ms"], rows)
    )


def _foreground(data: dict) -> str:
    rows = [
        [
            name,
            group,
            *(scores[k] for k in ("n", "dice", "iou")),
            data["alone"][name][group]["dice"],
            *(scores[k] for k in ("outside", "inside", "missed", "invented")),
            *(scores[k] for k in ("outlines_alone", "a_pixel_wider")),
        ]
        for name, part in data["sets"].items()
        for group, scores in part["groups"].items()
    ]
    worst = [
        [name, ", ".join(f"{n} {d}" for n, d in part["worst"])]
        for name, part in data["sets"].items()
    ]
    return (
        f"## Foreground: `{data['network']}` ({data['sha256']}), threshold {data['threshold']}\n\n"
        "`python -m tests.benchmarks.bench_foreground`: Dice and IoU per picture of the foreground as it is "
        "answered, then the mean; and how far, in pixels on average, its outline is outside and inside of the true "
        "one: much more on one side is a truth that is drawn wide or narrow; `missed` and `invented`: what lies "
        "farther than 4 px from the other, in percent of the true area; the last two: Dice if neither of these were, "
        "and of the same mask drawn one pixel wider all around. The thesis's best network has "
        "Dice 87.1 on all of `ewd`, the published ResNet-101 masks 90.6. Floors: `ewd` 91.5, its worst category 90, "
        "`photos100` 87, `bwh` 89.\n\n"
        + _table(_FOREGROUND, rows)
        + _strokes(data["strokes"])
        + _empty(data["empty"])
        + "\n"
        f"Network, letter-boxing and enlargement at 640 × 360 on two threads: median {data['time_ms']['median']} ms, "
        f"best {data['time_ms']['best']} ms.\n\n"
        + _others(data["others"])
        + "The ten worst of each set, by Dice:\n\n"
        + _table(["set", "worst"], worst)
        + "\n### RGB to instances on `ewd`\n\nThe whole chain with the default method. Floors: iou 84, "
        "iou_strict 80.5, pq 82, count 86.\n\n" + _quality(data["rgb_to_instances"])
    )


_FOREGROUND = [
    "set",
    "group",
    "n",
    "Dice",
    "IoU",
    "Dice, network alone",
    "outside",
    "inside",
    "missed %",
    "invented %",
    "outlines alone",
    "1 px wider",
]


def _empty(data: dict) -> str:
    rows = [
        [
            name,
            part["pictures"],
            part["false_pixels_percent"],
            ", ".join(part["pictures_with_instances"]) or "none",
        ]
        for name, part in data.items()
    ]
    return (
        "\nPictures without cables (floor: 0.1 % of pixels of the mixed ones). Textures were training backgrounds; "
        "the mixed ones hold railings, poles and cords, and `0003_height1` is a drawing of a winding strand.\n\n"
        + _table(["textures", "pictures", "false pixels %", "pictures with an instance"], rows)
    )


def _others(data: dict) -> str:
    rows = [[name, *scores.values()] for name, scores in data.items()]
    header = [
        "also shipped, on `ewd`",
        "Dice",
        "c1",
        "c2",
        "c3",
        "median ms",
        "best ms",
        "with the clean-up",
    ]
    return _table(header, rows) + "\n" if rows else ""


def _strokes(data: dict) -> str:
    return (
        "\n`m4nh` has strokes of one width as truth, some a few pixels off: "
        f"{data['found']} % of the true middle lines lie within {data['tolerance_px']} px of the foreground, "
        f"{data['right']} % of the foreground's middle lines within {data['tolerance_px']} px of a true one "
        f"({data['n']} pictures; worst by the lower of the two: "
        + ", ".join(f"{name} {value}" for name, value in data["worst"])
        + ").\n"
    )


def _quality(groups: dict) -> str:
    keys = ("n", "iou", "iou_strict", "dice", "pq", "count", "sem_dice")
    return _table(
        ["group", *keys], [[group, *(scores[k] for k in keys)] for group, scores in groups.items()]
    )


def _instances(title: str, asked: str) -> Any:
    def section(data: dict) -> str:
        time, crossings = data["time"], data["crossings"]
        named = {
            "best of repeats": "best_of_repeats",
            "median of repeats": "median_of_repeats",
            "processor": "processor",
        }
        times = [[name, time[key]["median"], time[key]["p95"]] for name, key in named.items()]
        worst = sorted(data["images"], key=lambda r: r["iou_strict"])[:10]
        return (
            f"## {title}\n\n`python -m tests.benchmarks.bench_instances --set {data['set']}`, orientation by "
            f"{data['orientation']}. {asked}\n\n"
            + _quality(data["quality"])
            + f"\nCrossings of two instances: {crossings['found']} of {crossings['true']} found, order right of "
            f"{crossings['order_right']} % of those.\n\n"
            + _table(["time of the instance stage, one thread, ms", "median", "p95"], times)
            + f"\n`skeletonize` on the same masks: {time['skeletonize']} ms; the instance stage takes "
            f"{time['ratio_to_skeletonize']} times as long (median of ratios).\n\nWorst by strict IoU: "
            + ", ".join(f"{r['name']} {100 * r['iou_strict']:.0f}" for r in worst)
            + ".\n"
        )

    return section


SECTIONS: dict[str, Any] = {
    "http": _http,
    "plant": plant_section,
    "throughput": throughput_section,
    "hosts": hosts_section,
    "bridge": bridge_section,
    "load": load_section,
    "faults": faults_section,
    "fuzz": fuzz_section,
    "properties": properties_section,
    "large": large_section,
    "foreground": _foreground,
    "photographs": photographs,
    "adaptation": adaptation,
    "reference": reference,
    "instances_ewd": _instances(
        "RT-DLO on the published masks of `ewd`",
        "`masks_r101` at threshold 77. Floor: IoU ≥ 78, median ≤ 13 ms, p95 ≤ 22 ms; published 79.9, "
        "its released code 78.4.",
    ),
    "instances_sbhc": _instances(
        "RT-DLO on `sbhc`", "The foreground of the true labels as mask, color picture."
    ),
    **report_training.SECTIONS,
    **report_planner.SECTIONS,
    "reconstruction": report_reconstruction.section,
    **report_labelling.SECTIONS,
    "methods": methods_section,
    "before": before_section,
    "masks": masks_section,
    "tangles": tangles_section,
    "topology": report_topology.topology,
    "disentangling": report_topology.disentangling,
    **report_tracking.SECTIONS,
}
