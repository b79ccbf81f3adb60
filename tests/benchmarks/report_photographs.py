"""Section of RESULTS.md on photographs that nobody prepared."""

from __future__ import annotations

from tests.benchmarks.markdown import table

_SETS = {"wild": "`wild`, never trained on", "aside": "training photographs kept aside"}


def photographs(data: dict) -> str:
    rows = [
        [title, effort, part["n"], part["found"], part["right"], part["dice"]]
        for name, title in _SETS.items()
        for effort, part in data[name].items()
    ]
    scales = [[name, *values.values()] for name, values in data["scales"].items()]
    empty, middle, large = data["empty"], data["middle"], data["large"]
    worst = [
        [title, ", ".join(f"{name} {dice}" for name, dice in data[key]["normal"]["worst"])]
        for key, title in _SETS.items()
    ]
    return (
        f"## Photographs of workshops: `{data['network']}` ({data['sha256']})\n\n"
        "`python -m tests.benchmarks.bench_photographs`: share of the true middle lines found, share of the found "
        "skeleton that is cable, Dice, per photograph, then the mean. Floors for `wild`: 90 / 90 / 80. Areas that "
        "nobody can tell count nowhere. An empty answer has 0 everywhere.\n\n"
        + table(["photographs", "effort", "n", "found %", "right %", "Dice"], rows)
        + f"\n{empty['pictures']} photographs without cables, kept aside: {empty['false_pixels_percent']} % false "
        "pixels (floor 0.3).\n\nThe same pictures resized, Dice (floor: within 5 of 1 ×):\n\n"
        + table(["set", *(f"{s} ×" for s in next(iter(data["scales"].values())))], scales)
        + f"\nCenterlines on `ewd` from RGB, 1.5 widths and more from crossings: {middle['mean_px']} px from "
        f"the true middle on average, {middle['mean_widths']} widths (floor 1.1 px).\n\n"
        f"A drawn photograph of 12 megapixels with {large['wires']} wires of 14 px: Dice {large['dice']}, of the wire "
        f"found worst {large['least_found_percent']} %; time {large['time_normal_over_fast']} × one pass "
        f"(floor 6), thorough {large['time_thorough_over_fast']} ×.\n\nThe worst, by Dice:\n\n"
        + table(["set", "worst"], worst)
    )
