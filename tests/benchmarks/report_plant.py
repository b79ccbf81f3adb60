"""Sections of RESULTS.md on running the service: what it costs, what it withstands."""

from __future__ import annotations

from collections import Counter
from typing import Any

from tests.benchmarks.markdown import table

_TEXTS = {
    "stalls": "A no-op, one after the other, one worker with a warm next child",
    "loop": "`/healthz` beside requests of 4 MiB (floor: 100 ms above nothing else)",
    "overhead": "Whole path less the stage's own time (floors: no-op 5 ms, `instances` 10 ms)",
    "robot": "An interactive no-op, beside 300 waiting batch jobs of 100 ms (floor: one job)",
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


def throughput_section(data: dict[str, Any]) -> str:
    """Service against bare pipeline; memory of large requests."""
    text = "## Service against the bare pipeline\n\n`python -m tests.benchmarks.bench_throughput`. "
    if rates := data.get("throughput"):
        rounds = ", ".join(str(pair) for pair in rates["rounds_percent"])
        text += (
            f"`instances` without files, {rates['jobs']} jobs each in alternating rounds (floor: 92 %; rounds: "
            f"{rounds}).\n\n"
            + table(
                ["processes", "bare, jobs per s", "service, jobs per s", "%"],
                [
                    [
                        rates["processes"],
                        rates["bare_per_s"],
                        rates["service_per_s"],
                        rates["percent"],
                    ]
                ],
            )
        )
        if "processor_percent" in rates:
            text += (
                f"\nProcessor time of a job, which other programs on the machine change little: {rates['bare_ms']} ms "
                f"bare, {rates['service_ms']} ms with all processes of the service, {rates['processor_percent']} %. "
                "(More jobs than bare: other programs took more from two processes than from the service's seven.)\n"
            )
    if memory := data.get("memory"):
        parts = [part for part in memory["cases"]["at rest"] if part != "answered"]
        text += (
            f"\nMost memory, MB, all processes of a part together; a child may take {memory['limit_mb']} MB:\n\n"
            + table(
                ["while", *parts, "answered"],
                [
                    [name, *(round(case[part]) for part in parts), case["answered"]]
                    for name, case in memory["cases"].items()
                ],
            )
        )
    return text


def hosts_section(data: dict[str, Any]) -> str:
    """Several hosts, and what one cable less does."""
    rows = [
        [
            name.replace("_", " "),
            row["jobs"],
            row["bad"],
            row["taken up again"],
            row["s"],
            row.get("back after s", ""),
        ]
        for name, row in data.items()
        if name not in ("rate", "timed")
    ]
    text = (
        "## Several hosts\n\n`python -m tests.rehearsal.hosts`: `deploy/three-hosts.yaml` on network namespaces with "
        "folders of their own, an S3 server, two replicas of the service behind a plain proxy, two hosts with a worker "
        "each.\n\n"
        + table(
            ["what", "jobs", "lost, doubled or wrong", "taken up again", "s", "back after s"], rows
        )
    )
    compared = {
        "timed": "a picture from the bucket and a wait of {wait_ms} ms, as if the processor of another machine worked",
        "rate": "real work, on the two cores that everything else runs on",
    }
    rows = [
        [text.format(**one), one["jobs"], one["one"], one["two"], one["ratio"]]
        for name, text in compared.items()
        if (one := data.get(name))
    ]
    if rows:
        text += "\nTwo hosts against one, in turn (floor: 1.7 times as many):\n\n"
        text += table(["a job is", "jobs", "one host, per s", "two hosts, per s", "times"], rows)
    return text


def fuzz_section(data: dict[str, Any]) -> str:
    """What became of generated and damaged requests."""
    rows = [
        [
            name,
            sum(ended.values()),
            ended.get("broken", 0),
            ", ".join(
                f"{what} {count}"
                for what, count in sorted(ended.items(), key=lambda one: -one[1])[:6]
            ),
        ]
        for name, ended in data["parts"].items()
    ]
    return (
        f"## Odd requests\n\n`python -m tests.fuzz`, seeds {data['seeds']}. Broken: a 5xx, an internal error, NaN, an "
        "answer that its contract does not allow, or a worker that dies. Floor: 0.\n\n"
        + table(["part", "requests", "broken", "most often"], rows)
        + data.get("note", "")
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
        [
            kind,
            rate["per_s"],
            rate["jobs"],
            rate["refused"],
            rate["lost"],
            rate["failed"],
            rate["p50_ms"],
            rate["p95_ms"],
            rate["worst_ms"],
        ]
        for kind, part in data.items()
        for rate in part["rates"]
    ]
    text = (
        "## Jobs at a rate\n\n`python -m tests.load`: jobs are sent when they are due, whatever the answers do; ms "
        "from due to ended. One worker.\n\n"
        + table(
            ["kind", "per s", "jobs", "refused", "lost", "failed", "p50 ms", "p95 ms", "worst ms"],
            rows,
        )
    )
    soaks = [
        [
            kind,
            soak["seconds"],
            soak["jobs"],
            soak["lost"] + soak["failed"],
            ", ".join(
                f"{part} {percent:+.1f} %" for part, percent in soak["grown_percent"].items()
            ),
        ]
        for kind, one in data.items()
        if (soak := one.get("soak"))
    ]
    if soaks:
        text += "\nSoak at half the rate that was kept:\n\n"
        text += table(["kind", "s", "jobs", "lost or failed", "memory"], soaks)
    return text


def faults_section(data: dict[str, Any]) -> str:
    """What became of the jobs under each fault."""
    rows = [
        [
            name,
            row.get("jobs", ""),
            row.get("faults", ""),
            row.get("lost", ""),
            row.get("doubled", ""),
            row.get("wrong", ""),
            row.get("failed", ""),
            row.get("worst_recovery_s", ""),
            row.get("load", ""),
            _fault_note(row),
        ]
        for name, row in data.items()
    ]
    return (
        "## Faults\n\n`python -m tests.faults`: real processes, each fault on a service of its own. Seconds: from the "
        "fault until a job sent right after it had ended, the slowest; load: how many programs wanted the two cores "
        "(floor: 8 s where none else does). Floor: nothing lost, doubled or wrong.\n\n"
        + table(
            ["fault", "jobs", "faults", "lost", "doubled", "wrong", "failed", "s", "load", "note"],
            rows,
        )
    )


def _fault_note(row: dict[str, Any]) -> str:
    parts = ", ".join(f"{part} {seconds} s" for part, seconds in row.get("recovery_s", {}).items())
    return "; ".join(text for text in (row["note"], parts) if text)


def properties_section(data: dict[str, Any]) -> str:
    """Generated requests by kind: answered, refused with a reason, broken."""
    rows = []
    for kind, seeds in data.items():
        ended: Counter[str] = Counter()
        for run in seeds.values():
            ended.update(run)
        often = ", ".join(f"{what} {count}" for what, count in ended.most_common(4))
        rows.append([kind, ", ".join(seeds), sum(ended.values()), ended["broken"], often])
    total, broken = (sum(row[column] for row in rows) for column in (2, 3))
    return (
        "## Generated requests\n\n`python -m tests.properties`: numbers of any size and degenerate geometry to every "
        "kind of job. Broken: `internal`, NaN, an answer that the contract does not allow, or one that took more than "
        f"the stated time. {total} requests, {broken} broken (floor: 0 of 20 000).\n\n"
        + table(["kind", "seeds", "requests", "broken", "most often"], rows)
    )


def large_section(data: dict[str, Any]) -> str:
    """What the files of a result cost on a large picture."""
    return (
        "## A picture of 12 megapixels\n\n`python -m tests.benchmarks.bench_large`: processor seconds of a default "
        f"`instances` request against `files: []`, in turn, {data['rounds']} rounds; the ratio is the median of the "
        "rounds' (floor: 1.15, aim 1.05).\n\n"
        + table(
            ["default s", "without files s", "ratio"],
            [[data["default_s"], data["no_files_s"], data["ratio"]]],
        )
    )
