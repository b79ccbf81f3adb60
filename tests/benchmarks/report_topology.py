"""The sections of RESULTS.md on wire harnesses."""

from __future__ import annotations

from typing import Any


def _table(header: list[str], rows: list[list[Any]]) -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def _photographs(data: dict) -> list[list]:
    return [
        [
            source,
            *(data[f"bwh_{source}"][key] for key in ("branch_f1", "crossing_f1", "counts_right")),
        ]
        for source in ("mask", "mask+color", "rgb")
    ]


def _curve(parts: dict) -> list[list]:
    return [
        [a["threshold"], a["precision"], a["recall"], b["precision"], b["recall"]]
        for a, b in zip(parts["links"], parts["classes"], strict=True)
    ]


def topology(data: dict) -> str:
    """Table 6.1, 6.2, Figs. 6.12 to 6.14, ``wh1``, ``bwh``, and the drawing."""
    keys = (
        "link_dice",
        "branch_accuracy",
        "crossing_accuracy",
        "branch_f1",
        "crossing_f1",
        "counts_right",
    )
    held = [
        [name, data[k]["scenes"], *(data[k][key] for key in keys)]
        for name, k in (("harder kinds", "synthetic"), ("as thesis 6.5.1", "synthetic_thesis"))
    ]
    parts, time, ablation = data["components"], data["time"], data["components"]["ablation"]
    angle = parts["orientation_deg"]
    instances = data["instances"]
    return (
        "## Topology of wire harnesses\n\n`python -m tests.benchmarks.bench_topology`. Synthetic scenes that training "
        "did not see, counted as thesis Table 6.1 (accuracy: found over found, false and missed; within 25 px, points "
        "nearer than that to the border left out). Floor, and the thesis on its real masks: .944 / .915 / .949; aim "
        ".97 each.\n\n"
        + _table(
            ["scenes", "n", "link Dice", "branch-points", "crossings", "F1", "F1", "both right"],
            held,
        )
        + f"\n`wh1`: {data['wh1']['right']} of {data['wh1']['of']} masks right (floor: all).\n\n"
        "`bwh`, 25 photographs, within 30 px. True masks: floor .80 / .88 / .60, aim .95 / .96 / .88; released code "
        ".705 / .867 / .49 on all 75. From RGB: aim .88 / .90 / .70.\n\n"
        + _table(["source", "branch F1", "crossing F1", "both counts right"], _photographs(data))
        + f"\nBranch identity with the drawing given, rendered: {data['identity']['right']} of "
        f"{data['identity']['branches']} branches = {data['identity']['share']} (floor .95, aim .99).\n\n"
        "Single components (Fig. 6.12) on held-out scenes:\n\n"
        + _table(
            ["threshold", "link precision", "recall", "node class precision", "recall"],
            _curve(parts),
        )
        + f"\nOrientation error {angle['mean']} ± {angle['spread']} degrees (thesis 0.63 ± 10.03), median "
        f"{angle['median_absolute']}.\n\nAblation (Fig. 6.14): links by RT-DLO's graph and similarity, Dice "
        f"{ablation['rt_dlo_link_dice']} against {data['synthetic']['link_dice']}; orientation by RT-DLO's network, "
        f"median error {ablation['rt_dlo_orientation_median_deg']} against {ablation['orientation_median_deg']}°.\n\n"
        "As an instance method (Fig. 6.13), each section an instance; measured, not offered: Dice "
        + ", ".join(f"{v['dice']} on `{k}`" for k, v in instances.items())
        + f".\n\nTime (Table 6.2) on the `wh1` masks at 640 × 480, one thread, processor time, best of repeats: mean "
        f"{time['total_ms']} ms, worst {time['worst_ms']} ms (floor 100, aim 30; thesis 43.9 with a GPU, released code "
        "231 to 304).\n"
    )


def disentangling(data: dict) -> str:
    rows = []
    for name, row in data.items():
        ends = ", ".join(f"{k} {v}" for k, v in sorted(row["triple"]["ends"].items()))
        rows.append(
            [
                name,
                row["single"]["scenes"],
                row["single"]["removed"],
                row["triple"]["scenes"],
                row["triple"]["solved"],
                ends,
            ]
        )
    return (
        "## Disentangling\n\n`python -m tests.benchmarks.bench_disentangling`: simulated scenes, arms that err by 2 px "
        "and 3 degrees, a piece that lies under another cannot be moved. `seen`: from the mask and points in space; "
        "`true`: from the true topology. One crossing removed by the best-ranked action: floor .90, aim .98. Three "
        "crossings solved by repeated planning, the count never raised: floor .75, aim .95.\n\n"
        + _table(
            ["topology", "scenes", "one removed", "scenes", "three solved", "how they ended"], rows
        )
    )
