"""Sections of RESULTS.md on making data and training from it."""

from __future__ import annotations

import numpy as np

from models.training.foreground.mixture import factorial_table
from models.training.foreground.validation import RULE
from tests.benchmarks.markdown import table


def _setting(data: dict) -> str:
    s = data["settings"]
    begun = "ImageNet encoder weights" if s["pretrained"] else "random weights"
    return (
        f"{s['width']} × {s['height']} px, {s['minutes_per_run']:g} processor minutes a run, batch {s['batch']}, "
        f"from {begun}; Dice on `ewd`"
    )


def synthesis(data: dict) -> str:
    rows = [
        [
            size,
            e["images_per_second"],
            e["jpeg_round_trips"],
            "yes" if e["same_seed_same_bytes"] else "NO",
        ]
        for size, e in data["sizes"].items()
    ]
    return (
        "## Rendering labelled pictures\n\n`python -m tests.benchmarks.bench_synthesis`: one core, processor time; "
        "the time of the same pictures through a JPEG encoder and decoder is the unit of the third column.\n\n"
        + table(
            ["size", "pictures a second", "JPEG round trips a picture", "same seed, same bytes"],
            rows,
        )
    )


def chroma_key(data: dict) -> str:
    rows = [
        [name, r["n"], r["dice"], r["worst"], r["warned"]] for name, r in data["recordings"].items()
    ]
    return (
        "## Chroma key on real pictures\n\n`python -m tests.benchmarks.bench_chroma_key`: the keyed masks of `bwh` (a "
        f"glossy green mat under lamps), ranges found by themselves: Dice {data['dice']} (floor 83). Before highlights "
        "were told from cables it was 75.8. With the ranges picked on every other picture of a recording "
        f"{data['chosen']} on the rest (floor 86), where the found ones give {data['found_on_the_others']}. `warned`: "
        "pictures in which something has the screen's own hue; those with a green wire.\n\n"
        + table(["recording", "pictures", "Dice", "worst", "warned"], rows)
    )


def compare(data: dict) -> str:
    groups: dict[str, list[dict]] = {}
    for key, run in data["runs"].items():
        groups.setdefault(key.rsplit("_run", 1)[0], []).append(run)
    kinds = list(next(iter(data["runs"].values()))["dice"])
    rows = [
        [name, len(runs), *(round(float(np.mean([r["dice"][k] for r in runs])), 2) for k in kinds)]
        for name, runs in groups.items()
    ]
    return (
        "## Chroma key against rendered data (as Table 2.1)\n\n`python -m models.training.foreground.mixture compare`: "
        f"the compact network on 810 pictures of either kind, {_setting(data)}. Both kinds are made here: `chroma` is "
        "keyed from 90 recorded pictures before a rendered screen.\n\n"
        + table(["data", "runs", *kinds], rows)
    )


def networks(data: dict) -> str:
    rows = [
        [
            key.rsplit("_run", 1)[0],
            round(r["parameters"] / 1e6, 2),
            r["pictures"],
            data["settings"]["minutes_per_run"] if r["pictures"] else 0,
            *r["dice"].values(),
        ]
        for key, r in data["runs"].items()
    ]
    kinds = list(next(iter(data["runs"].values()))["dice"])
    return (
        "## Networks on equal terms, at reduced size\n\n`python -m models.training.foreground.mixture networks`: all "
        f"on the same {data['settings']['count']} rendered pictures, {_setting(data)}. `/4`: channels divided by four; "
        f"no network: {RULE}. "
        "No GPU was there: a comparison of what short training on a processor reaches, not of the full networks.\n\n"
        + table(["network", "million weights", "pictures seen", "processor minutes", *kinds], rows)
    )


def mixture(data: dict) -> str:
    real = "hand-marked photographs of workshops and of hardware projects"
    tables = {"`ewd`": "dice", "photographs of workshops kept aside": "photographs"}
    runs = max(int(key.rsplit("run", 1)[1]) + 1 for key in data["runs"])
    return (
        "## Mixtures by ratio (Table 2.2, small)\n\n`python -m models.training.foreground.mixture factorial --marked "
        f"--scale {data['settings']['scale']:g} --runs {runs}`: the counts of the table times that scale, real ones "
        f"are {real}; {_setting(data)} and on photographs of that kind, mean ± standard deviation over {runs} runs "
        "with other pictures.\n\n"
        + "\n\n".join(
            f"{name}:\n\n```\n{factorial_table(data['runs'], key)}\n```"
            for name, key in tables.items()
        )
        + "\n"
    )


SECTIONS = {
    "chroma_key": chroma_key,
    "synthesis": synthesis,
    "compare": compare,
    "networks": networks,
    "mixture": mixture,
}
