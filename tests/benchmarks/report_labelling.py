"""The sections of RESULTS.md about labelling: batches, DLO-WSL, and clicks in the corrector."""

from __future__ import annotations

from typing import Any

from tests.benchmarks.markdown import table


def batches(data: dict[str, Any]) -> str:
    speed, kills = data["throughput"], data["killed"]
    rows = [
        [
            "throughput against the bare pipeline, two workers, by processor time a picture",
            "≥ 85 %",
            "≥ 95 %",
            f"{speed['cpu_ratio_percent']} %",
        ],
        [
            "processor time a picture in each run, ms: bare / batch",
            "",
            "",
            f"{_listed(speed['bare_cpu_ms'])} / {_listed(speed['batch_cpu_ms'])}",
        ],
        [
            f"by the clock, against one process of one thread / of two (load {speed['load']})",
            "",
            "",
            f"{speed['wall_ratio_percent']} % / {speed['wall_ratio_both_cores_percent']} %",
        ],
        [
            f"pictures labelled, of {kills['pictures']} (SIGKILL × {kills['kills']})",
            "all, once",
            "",
            kills["labelled"],
        ],
        [
            "labelled twice / jobs done twice / half files left",
            "0 / 0 / 0",
            "",
            f"{kills['twice']} / {kills['jobs_done_twice']} / {kills['parts_left']}",
        ],
    ]
    return (
        "## Labelling a folder\n\n`python -m tests.benchmarks.bench_labelling`: "
        f"{speed['pictures']} new pictures of 640 × 360 in each of {speed['repeats']} runs in turn, through the stage "
        f"alone in one process ({min(speed['bare_cpu_ms']):.0f} ms of processor time a picture) and through the "
        f"service with two workers ({min(speed['batch_cpu_ms']):.0f} ms, client, service, queue and workers "
        "together; the least of the runs: neighbors only add to it). Processor time does not depend on the share "
        "of the machine that a process gets; the clock does. "
        "Then `dlo label` killed ten times.\n\n" + table(["", "floor", "aim", "measured"], rows)
    )


def _listed(values: list[float]) -> str:
    return ", ".join(f"{value:.0f}" for value in values)


def _goals(data: dict[str, Any]) -> list[list[Any]]:
    """Every figure of the issue, with what is measured."""
    found = data["corrector"]["as in the thesis, marked"]
    best = data["variants"]["corrections agree, width measured, ends found"]
    return [
        ["corrector: mean offset error, px", "± 0.1", "", "0.05", found["mean_px"]],
        ["corrector: SD of it, px", "≤ 1.6", "≤ 0.9", "1.57", found["sd_px"]],
        ["DLO-WSL: IoU, %", "81", "90", "81.1", best["iou"]],
        [
            f"DLO-WSL: IoU per click, % ({data['clicks']:g} clicks)",
            "6.5",
            "9",
            "6.5",
            best["per_click"],
        ],
        [
            "without correction: IoU, %",
            "",
            "",
            "36.9",
            data["variants"]["strokes as drawn, smoothed"]["iou"],
        ],
    ]


def tracked(data: dict[str, Any]) -> str:
    corrector = data["corrector"]
    crops = [
        [
            name,
            v["mean_px"],
            v["sd_px"],
            v["median_abs_px"],
            round(100 * v["over_3px"], 1),
            v["width_error"],
        ]
        for name, v in corrector.items()
    ]
    rows = [
        [name, v["iou"], v["sd"], v["worst"], v["worst_view"]]
        for name, v in data["variants"].items()
    ]
    return (
        "## DLO-WSL\n\n`python -m tests.benchmarks.bench_tracked --textures TEXTURES.npz`: "
        f"{data['scenes']} rendered scenes of 2 cables in 10 views with errors of hand, tracker and calibration, and "
        f"the corrector on 1000 crops of each kind, of scenes that nothing else uses (backgrounds: "
        f"{data['backgrounds']}). As in the thesis: cables of 10 to 20 px, nothing else about; as in training: 5 to 31 "
        "px among tools, boards and decoys. Marked: the cable stands out by 12 of 255 and no other is within 4 px as "
        "near; all: as they fall.\n\n"
        + table(["", "floor", "aim", "thesis", "measured"], _goals(data))
        + "\n"
        + table(["crops", "mean px", "SD px", "median px", "over 3 px, %", "width off by"], crops)
        + "\n"
        + table(["labels from", "IoU %", "SD", "worst scene", "worst view"], rows)
    )


def clicks(data: dict[str, Any]) -> str:
    found = data["summaries"]
    rows = [
        [
            "clicks and drags a cable, mean (20 where it is never reached)",
            "≤ 6",
            "≤ 3",
            *_each(found, "mean"),
        ],
        ["the same, median", "", "", *_each(found, "median")],
        ["cables within 3, %", "≥ 75", "≥ 85", *_each(found, "within_3_percent")],
        ["cables within 6, %", "≥ 92", "≥ 97", *_each(found, "within_6_percent")],
        ["cables that never reach it in 20, %", "", "", *_each(found, "never_percent")],
        ["their best IoU", "", "", *_each(found, "best_iou_of_never")],
        ["cables that need nothing, %", "", "", *_each(found, "none_percent")],
        [
            "IoU at the start: after the two clicks, or as the service gave it, %",
            "",
            "",
            *_each(found, "first_iou_percent"),
        ],
    ]
    return (
        f"## Clicks on the label bench\n\n`python -m tests.benchmarks.bench_clicks`: all {found['clicked']['cables']} "
        "cables of `ewd`, simulated clicks and drags through the page's own code until IoU 90 % with the hand-made "
        "label. The person knows the true mask, has an exact hand and acts where the error is largest, and drags the "
        "cable as a whole, its width or one of its edges all along (one drag) where that takes away half of the "
        "edges' error or more; pixels of other cables count neither way. **Clicked**: nothing is there, the person "
        "clicks both ends first, and these two clicks count. **Corrected**: what a person has in practice, the cables "
        "of the service are there when the picture opens; one that is right needs nothing, one that overlaps by 70 % "
        "is dragged to where it should be, any other is drawn anew, and pieces too many are removed, each of which "
        "counts. The page's weights were chosen on rendered scenes (below), four of them long ago on every third "
        f"picture here, which the last columns leave out ({found['clicked_aside']['cables']} cables). That edges are "
        "dragged all along was added with labels like these in mind, so all columns are figures of development. The "
        "labels of the first category lie .8 px (median of 39 cables) above the pictures' own steepest steps, those "
        "of the others .2 and .3. RITM took about 40 clicks in the thesis's test.\n\n"
        + table(
            [
                "",
                "floor",
                "aim",
                "clicked",
                "corrected",
                "clicked, not tuned on",
                "corrected, not tuned on",
            ],
            rows,
        )
    )


def clicks_shaken(data: dict[str, Any]) -> str:
    return (
        f"## Clicks with a hand that errs by {data['hand_px']:g} px\n\n`python -m tests.benchmarks.bench_clicks --hand "
        f"{data['hand_px']:g}`: as above, with that standard deviation in x and y of every click and in every drag; in "
        f"pixels of the picture as it is shown unzoomed.\n\n{_short(data)}"
    )


def clicks_rendered(data: dict[str, Any]) -> str:
    return (
        "## Clicks on renders with labels as a hand draws them\n\n`python -m tests.benchmarks.bench_clicks "
        "--rendered`: what the page's weights are chosen on, the even ones of the pictures; the odd ones are the last "
        "columns. Cables of 4 to 40 px on plain and painted grounds, in workshops and in the air; the label of a "
        "picture is off alike by .5 px (standard deviation in x and y), a cable is wider by .35 ± .4 px on either "
        "side, its line wavers by .4 px and its half width by .3 px. Many cables are thin, hidden in part or beside "
        "others of their color: these figures are for comparing outlines, not for what people need.\n\n"
        f"{_short(data)}"
    )


def clicks_rendered_shaken(data: dict[str, Any]) -> str:
    return (
        f"## Clicks on these renders with a hand that errs by {data['hand_px']:g} px\n\n`python -m "
        f"tests.benchmarks.bench_clicks --rendered --hand {data['hand_px']:g}`.\n\n{_short(data)}"
    )


def _short(data: dict[str, Any]) -> str:
    found = data["summaries"]
    texts = {
        "mean": "mean",
        "within_3_percent": "within 3, %",
        "within_6_percent": "within 6, %",
        "never_percent": "never, %",
    }
    rows = [
        ["cables", *_each(found, "cables")],
        *([text, *_each(found, name)] for name, text in texts.items()),
    ]
    return table(
        ["", "clicked", "corrected", "clicked, not tuned on", "corrected, not tuned on"], rows
    )


def _each(found: dict[str, Any], name: str) -> list[Any]:
    return [found[part][name] for part in ("clicked", "given", "clicked_aside", "given_aside")]


def pages(data: dict[str, Any]) -> str:
    """What a large picture costs on the label bench."""
    texts = {
        "open": ("from choosing the file until a click counts", "≤ 2000", "≤ 1000"),
        "click": (
            "from the key that ends a line of two clicks until its outline is drawn",
            "≤ 150",
            "≤ 50",
        ),
        "drag": ("from the end of a drag at an edge until the outline is drawn", "≤ 150", "≤ 50"),
        "zoom": ("a turn of the wheel until the frame is drawn", "", ""),
    }
    rows = [
        [*text, data["median_ms"][name], _listed(data["ms"][name])] for name, text in texts.items()
    ]
    return (
        "## 12 megapixels on the label bench, ms\n\n`python -m tests.benchmarks.bench_pages`: headless Chromium "
        "without a graphics card, twelve cables of the service in the picture and one more drawn; medians, and every "
        f"run; load of the machine meanwhile {data['load']} on two cores: the last row, 17 ms where nothing else runs, "
        "shows how much of all rows is waiting for others.\n\n"
        + table(["", "floor", "aim", "median", "runs"], rows)
    )


SECTIONS = {
    "labelling": batches,
    "tracked": tracked,
    "clicks": clicks,
    "clicks_hand1": clicks_shaken,
    "clicks_rendered": clicks_rendered,
    "clicks_rendered_hand1": clicks_rendered_shaken,
    "pages": pages,
}
