"""Sections of RESULTS.md on running the service: what it costs, what it withstands."""

from __future__ import annotations

from typing import Any

from tests.benchmarks.markdown import table

_TEXTS = {
    "stalls": "A no-op, one after the other, one worker with a warm next child",
    "loop": "`/healthz` beside requests of 4 MiB (floor: 100 ms above nothing else)",
    "overhead": "Whole path less the stage's own time (floors: no-op 5 ms, `instances` 10 ms)",
    "robot": "An interactive no-op beside 300 waiting batch jobs of 100 ms (floor: one job)",
}


def plant_section(data: dict[str, Any]) -> str:
    """Stalls, event loop, overhead and priority, in milliseconds."""
    rows = [
        [f"{_TEXTS[name]}: {case}", part["n"], part["p50"], part["p95"], part["worst"]]
        for name, cases in data.items()
        for case, part in cases.items()
    ]
    return (
        "## Service under load, ms\n\n`python -m tests.benchmarks.bench_plant`. Measured beside other programs on a "
        "machine with two cores.\n\n" + table(["what", "n", "p50", "p95", "worst"], rows)
    )


def bridge_section(data: dict[str, Any]) -> str:
    """A recipe by a controller beside the same over REST."""
    row = [data[name] for name in ("rounds", "rest_ms", "tcp_ms", "added_ms", "error_ms")]
    return (
        "## A recipe over TCP\n\n`python -m tests.benchmarks.bench_bridge`: trigger and result by `dlo bridge`, and "
        "the same recipe and picture over REST, in turn; medians. Floor: 3 ms more, aim 1 ms.\n\n"
        + table(["rounds", "REST ms", "TCP ms", "TCP adds ms", "standard error ms"], [row])
    )


def load_section(data: dict[str, Any]) -> str:
    """Open-loop load, and what memory did meanwhile."""
    rows = [
        [kind, rate["per_s"], rate["jobs"], rate["refused"], rate["lost"], rate["failed"], rate["p50_ms"],
         rate["p95_ms"], rate["worst_ms"]]
        for kind, part in data.items()
        for rate in part["rates"]
    ]  # fmt: skip
    text = (
        "## Jobs at a rate\n\n`python -m tests.load`: jobs are sent when they are due, whatever the answers do; ms "
        "from due to ended. One worker.\n\n"
        + table(["kind", "per s", "jobs", "refused", "lost", "failed", "p50 ms", "p95 ms", "worst ms"], rows)
    )
    soaks = [
        [kind, soak["seconds"], soak["jobs"], soak["lost"] + soak["failed"],
         ", ".join(f"{part} {percent:+.1f} %" for part, percent in soak["grown_percent"].items())]
        for kind, one in data.items()
        if (soak := one.get("soak"))
    ]  # fmt: skip
    if soaks:
        text += "\nSoak at half the rate that was kept:\n\n"
        text += table(["kind", "s", "jobs", "lost or failed", "memory"], soaks)
    return text


def faults_section(data: dict[str, Any]) -> str:
    """What became of the jobs under each fault."""
    rows = [
        [name, row.get("jobs", ""), row.get("faults", ""), row.get("lost", ""), row.get("doubled", ""),
         row.get("wrong", ""), row.get("failed", ""), row.get("worst_recovery_s", ""), row["note"]]
        for name, row in data.items()
    ]  # fmt: skip
    return (
        "## Faults\n\n`python -m tests.faults`: real processes, each fault on a service of its own. Seconds: from the "
        "fault until a job sent right after it had ended, the slowest. Floor: nothing lost, doubled or wrong.\n\n"
        + table(["fault", "jobs", "faults", "lost", "doubled", "wrong", "failed", "s", "note"], rows)
    )
