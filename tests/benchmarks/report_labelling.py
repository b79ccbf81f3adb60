"""The sections of RESULTS.md about labelling: batches, DLO-WSL, and clicks in the corrector."""

from __future__ import annotations

from typing import Any

from tests.benchmarks.markdown import table


def batches(data: dict[str, Any]) -> str:
    speed, kills = data["throughput"], data["killed"]
    rows = [
        ["throughput against the bare pipeline, two workers", "≥ 85 %", "≥ 95 %", f"{speed['ratio_percent']} %"],
        ["the same by processor seconds a picture, %", "", "", speed.get("cpu_ratio_percent", "not run")],
        [f"pictures labelled, of {kills['pictures']} (SIGKILL × {kills['kills']})", "all, once", "", kills["labelled"]],
        ["labelled twice / jobs done twice / half files left", "0 / 0 / 0", "",
         f"{kills['twice']} / {kills['jobs_done_twice']} / {kills['parts_left']}"],
    ]  # fmt: skip
    return (
        "## Labelling a folder\n\n`python -m tests.benchmarks.bench_labelling`: "
        f"{speed['pictures']} pictures of 640 × 360 through the stage alone in one process "
        f"({speed['bare_per_s']} a second) and through the service ({speed['batch_per_s']} a second), best of three "
        "runs in turn; then `dlo label` killed ten times.\n\n"
        + table(["", "floor", "aim", "measured"], rows)
    )  # fmt: skip


def tracked(data: dict[str, Any]) -> str:
    corrector = {name.removeprefix("rendered_"): value for name, value in data["corrector"].items()}
    best = data["variants"]["corrections agree, width measured"]
    goals = [
        ["corrector with the thickness known: mean error, px", "± 0.1", "", "0.05", corrector["mean_px_known_width"]],
        ["corrector with the thickness known: SD, px", "≤ 1.6", "≤ 0.9", "1.57", corrector["sd_px_known_width"]],
        ["corrector alone: mean offset error, px", "± 0.1", "", "0.05", corrector["mean_px"]],
        ["corrector alone: SD of it, px", "≤ 1.6", "≤ 0.9", "1.57", corrector["sd_px"]],
        ["corrector: median absolute error, px", "", "", "", corrector["median_abs_px"]],
        ["corrector: SD over all crops, also unmarkable ones, px", "", "", "", corrector["sd_px_any"]],
        ["DLO-WSL: IoU, %", "81", "90", "81.1", best["iou"]],
        [f"DLO-WSL: IoU per click, % ({data['clicks']:g} clicks)", "6.5", "9", "6.5", best["per_click"]],
    ]
    rows = [[name, v["iou"], v["sd"], v["worst"]] for name, v in data["variants"].items()]
    return (
        "## DLO-WSL\n\n`python -m tests.benchmarks.bench_tracked`: the corrector on 1000 crops of scenes that training "
        "never saw, on which the DLO stands out and it is plain which one is meant (`train_corrector.evaluate`), and "
        f"{data['scenes']} rendered scenes of 2 cables in 10 views with errors of hand, tracker and calibration.\n\n"
        + table(["", "floor", "aim", "thesis", "measured"], goals)
        + "\n"
        + table(["labels from", "IoU %", "SD", "worst scene"], rows)
    )


def clicks(data: dict[str, Any]) -> str:
    s = data["summary"]
    rows = [
        ["clicks and drags a cable, mean (20 where it is never reached)", "≤ 6", "≤ 3", s["mean"]],
        ["the same, median", "", "", s["median"]],
        ["cables within 3 / within 6, %", "", "", f"{s['within_3_percent']} / {s['within_6_percent']}"],
        ["cables that never reach it in 20, %", "", "", s["never_percent"]],
        ["their best IoU", "", "", s["best_iou_of_never"]],
        ["IoU after the two clicks on the ends, %", "", "", s["iou_after_two_percent"]],
    ]
    return (
        f"## Clicks in the corrector\n\n`python -m tests.benchmarks.bench_clicks`: all {s['cables']} cables of `ewd`, "
        "simulated clicks and drags through the page's own `outline.js` until IoU 90 % with the hand-made label. The "
        "person knows the true mask, has an exact hand and acts where the error is largest; pixels of other cables "
        "count neither way. The page's weights were set on rendered scenes. RITM took about 40 clicks in the "
        "thesis's test.\n\n" + table(["", "floor", "aim", "measured"], rows)
    )


SECTIONS = {"labelling": batches, "tracked": tracked, "clicks": clicks}
