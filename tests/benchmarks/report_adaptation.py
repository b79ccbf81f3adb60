"""Sections of RESULTS.md on a network of one's own, and on pictures of the empty place."""

from __future__ import annotations

from tests.benchmarks.markdown import table

_SETS = {"photos100": "`photos100`, the others", "ewd": "`ewd`", "sbhc": "`sbhc`", "bwh": "`bwh`"}


def adaptation(data: dict) -> str:
    before, after, report = data["before"], data["after"], data["report"]
    rows = [
        [title, before[k], after[k], round(after[k] - before[k], 2)] for k, title in _SETS.items()
    ]
    every = data.get("every", 1)
    part = "" if every == 1 else f" Measured on one picture of {every}."
    return (
        f"## Adapting `{data['parent']}` to ten labelled photographs\n\n"
        "`python -m tests.benchmarks.bench_adaptation`: every fifth of `photos100` as a user's pictures, of which "
        f"{report['pictures']} are learnt from and {len(report['kept_aside'])} kept aside; the network is used for "
        f"this measurement alone. {report['steps']} steps, {data['minutes']} minutes of learning on one core that "
        f"others used too; {100 * report['share']:.0f} % of the learnt weights kept. Floors: 8 points on the others, "
        f"1.0 lost on each general set, 25 minutes on two cores.{part}\n\n"
        + table(["set", "Dice before", "after", "difference"], rows)
        + f"\nKept aside: {report['before']:.1f} before, {report['after']:.1f} after; renders that decide what is "
        f"forgotten: {report['general_before']:.1f} and {report['general_after']:.1f}.\n"
    )


def reference(data: dict) -> str:
    rows = [
        ["all", data["cells"], data["alone"], data["with"], round(data["with"] - data["alone"], 2)],
        [
            "hard: below 80 alone",
            data["hard_cells"],
            data["hard_alone"],
            data["hard_with"],
            round(data["hard_with"] - data["hard_alone"], 2),
        ],
    ]
    return (
        "## A picture of the empty place\n\n"
        "`python -m tests.benchmarks.bench_reference`: rendered cells in new light, six in ten under an arm's shadow, "
        "the camera moved by about 3 px. Floor on hard grounds: 5 points.\n\n"
        + table(["cells", "n", "Dice alone", "with the reference", "difference"], rows)
        + f"\nUsed in {data['used_percent']} % of the cells; pictures of another place were used in "
        f"{data['other_place_used_percent']} %. {data['worse_by_two']} cells lost more than 2 points.\n"
    )
