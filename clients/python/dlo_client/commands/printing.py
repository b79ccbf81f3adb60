"""What the ``dlo`` command prints. Piped output has no width: no line is broken, no column cut."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

from dlo_client.contracts import (
    AnyJob,
    Crossing,
    Instance,
    InstancesResult,
    Job,
    NetworkInfo,
    SegmentResult,
    StrandPosition,
)
from dlo_client.outcomes import result_of

_PIPED_WIDTH = 1000
_ORDER_UNKNOWN = 0.5


def print_instances(image: Path, job: Job[InstancesResult], saved: Sequence[Path]) -> None:
    result = result_of(job)
    out = _console()
    found = (
        f"{_count(len(result.instances), 'instance')}, {_count(len(result.crossings), 'crossing')}"
    )
    _line(out, f"{image}: {result.width} x {result.height}, {found}")
    if result.instances:
        out.print(_instance_table(result.instances))
    if result.crossings:
        out.print(_crossing_table(result.crossings))
    _print_foot(out, job, saved)


def print_segment(image: Path, job: Job[SegmentResult], saved: Sequence[Path]) -> None:
    result = result_of(job)
    out = _console()
    share = f"{result.coverage:.1%} cable at threshold {result.threshold:.2f}"
    _line(out, f"{image}: {result.width} x {result.height}, {share}")
    _print_foot(out, job, saved)


def print_job_as_json(image: Path, job: Job[Any], saved: Sequence[Path]) -> None:
    """One line: ``{"image": path, "saved": [paths], "job": the job as the API gives it}``."""
    record = {
        "image": str(image),
        "saved": [str(path) for path in saved],
        "job": job.model_dump(mode="json"),
    }
    print(json.dumps(record))


def print_jobs(jobs: Iterable[AnyJob]) -> None:
    table = _table(["id", "state", "kind", "progress", "created", "seconds", "label"], right=[3, 5])
    for job in jobs:
        table.add_row(
            job.id,
            job.state,
            job.kind,
            f"{job.progress:.0%}",
            f"{job.created_at.astimezone():%Y-%m-%d %H:%M:%S}",
            _seconds(job.started_at, job.ended_at),
            job.label or "",
        )
    _console().print(table)


def print_networks(networks: Iterable[NetworkInfo]) -> None:
    table = _table(
        ["name", "version", "task", "default", "warm", "MB", "sha256", "from", "metrics"], right=[5]
    )
    for network in networks:
        table.add_row(
            network.name,
            network.version,
            network.task,
            "yes" if network.default else "",
            "yes" if network.warm else "",
            f"{network.bytes / 1e6:.1f}",
            network.sha256[:12],
            "the release" if network.shipped else network.parent or "a file",
            ", ".join(f"{name} {value:.3g}" for name, value in network.metrics.items()),
        )
    _console().print(table)


def print_versions(network: NetworkInfo) -> None:
    """The one that the name stands for is marked."""
    table = _table(["version", "", "stored", "sha256", "from", "metrics"], right=[0])
    for one in network.versions:
        table.add_row(
            str(one.version),
            "in service" if str(one.version) == network.version else "",
            f"{one.created_at:%Y-%m-%d %H:%M}",
            one.sha256[:12],
            one.parent or "a file",
            ", ".join(f"{name} {value:.3g}" for name, value in one.metrics.items()),
        )
    _console().print(table)


def print_lines(lines: Iterable[str]) -> None:
    for line in lines:
        _line(_console(), line)


def print_rows(
    head: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    job: Job[Any],
    saved: Sequence[Path],
) -> None:
    """A line, a table if there are rows, then what the job's steps took and what was saved."""
    out = _console()
    _line(out, head)
    if rows:
        table = _table(list(columns), right=[])
        for row in rows:
            table.add_row(*row)
        out.print(table)
    _print_foot(out, job, saved)


def print_error(text: str) -> None:
    _line(_console(stderr=True), f"error: {text}")


def _instance_table(instances: Iterable[Instance]) -> Table:
    table = _table(["instance", "score", "width px", "length px", "ends"], right=[0, 1, 2, 3])
    for instance in instances:
        ends = ", ".join(endpoint.kind for endpoint in instance.endpoints)
        table.add_row(
            str(instance.id),
            f"{instance.score:.2f}",
            f"{instance.width_px:.1f}",
            f"{instance.length_px:.0f}",
            "closed ring" if instance.closed else ends,
        )
    return table


def _crossing_table(crossings: Iterable[Crossing]) -> Table:
    table = _table(["crossing", "at x, y", "over", "under", "score"], right=[0, 1, 4])
    for crossing in crossings:
        x, y = crossing.xy
        score = f"{crossing.score:.2f}"
        unknown = " (order unknown)" if crossing.score <= _ORDER_UNKNOWN else ""
        strands = _strand(crossing.over), _strand(crossing.under)
        table.add_row(str(crossing.id), f"{x:.0f}, {y:.0f}", *strands, score + unknown)
    return table


def _strand(position: StrandPosition) -> str:
    return f"{position.instance} at {position.u:.0%}"


def _print_foot(out: Console, job: Job[Any], saved: Sequence[Path]) -> None:
    if job.timings_ms:
        _line(out, f"  ms: {_stages(job.timings_ms)}")
    for path in saved:
        _line(out, f"  saved {path}")


def _stages(timings_ms: Mapping[str, float]) -> str:
    """``a 3.0 (b 1.0, c 2.0)`` for stages ``a``, ``a.b`` and ``a.c``."""
    return ", ".join(
        f"{stage} {value:.1f}" + _steps(timings_ms, f"{stage}.")
        for stage, value in timings_ms.items()
        if "." not in stage
    )


def _steps(timings_ms: Mapping[str, float], prefix: str) -> str:
    steps = [(name, value) for name, value in timings_ms.items() if name.startswith(prefix)]
    listed = ", ".join(f"{name.removeprefix(prefix)} {value:.1f}" for name, value in steps)
    return f" ({listed})" if listed else ""


def _console(stderr: bool = False) -> Console:
    console = Console(stderr=stderr, highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = _PIPED_WIDTH
    return console


def _line(out: Console, text: str) -> None:
    out.print(text, soft_wrap=True)


def _table(columns: Sequence[str], right: Sequence[int]) -> Table:
    """``right``: the indices of the columns of numbers."""
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False)
    for index, column in enumerate(columns):
        table.add_column(column, justify="right" if index in right else "left", overflow="fold")
    return table


def _seconds(start: datetime | None, end: datetime | None) -> str:
    return f"{(end - start).total_seconds():.2f}" if start and end else ""


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
