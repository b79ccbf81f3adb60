"""A recording on another version, or with another network: what changed, for better or worse, and
how fast it is.

What is better is not guessed. An answer that changed where the cell could use it is at risk; one
that changed where the cell could not may be mended; the rest is counted. Needs
``dlo-client[label]`` to compare masks.
"""

from __future__ import annotations

import json
import statistics
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

from dlo_client.client import Client
from dlo_client.contracts import InstancesResult, Job
from dlo_client.errors import DLOError, InvalidRequest, JobFailed
from dlo_client.labelling.labels import label_of
from dlo_client.recording import Entry, RecordingError, pictures_of

Verdict = Literal[
    "same", "at_risk", "may_be_mended", "changed", "still_bad", "broken", "works_now", "still_fails"
]
SAME_IOU = 0.95
"""Mean over the instances of both answers, from which two answers are the same to a cell."""
_SHOWN = 20
_MEANING: dict[Verdict, str] = {
    "broken": "answered then, fails now",
    "at_risk": "could be used then, is another answer now",
    "changed": "another answer; nobody noted whether the one of then could be used",
    "may_be_mended": "could not be used then, is another answer now",
    "works_now": "failed then, answers now",
    "still_bad": "could not be used then, is the same answer now",
    "still_fails": "failed then and now",
    "same": "the same answer",
}
"""In the order of a report, the worst first."""


@dataclass(frozen=True)
class Replayed:
    """One request then and now. ``alike``: 1 for the same answer, 0 for another one altogether."""

    id: str
    kind: str
    verdict: Verdict
    alike: float
    what: str
    before_ms: float | None
    after_ms: float | None


@dataclass
class ReplayReport:
    """All requests of a recording; ``changes``: fields that were asked for anew."""

    changes: dict[str, Any]
    rows: list[Replayed] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Whether nothing that the cell could use is at risk, and nothing broke."""
        return not any(row.verdict in ("broken", "at_risk") for row in self.rows)

    def lines(self) -> list[str]:
        """For a person."""
        counts = Counter(row.verdict for row in self.rows)
        out = [f"{len(self.rows)} requests"]
        out += [
            f"  {counts[verdict]:5d} {meaning}"
            for verdict, meaning in _MEANING.items()
            if counts[verdict]
        ]
        for verdict in _MEANING:
            rows = sorted(
                (row for row in self.rows if row.verdict == verdict != "same"),
                key=lambda row: row.alike,
            )
            out += [f"{verdict}: {row.id} ({row.kind}): {row.what}" for row in rows[:_SHOWN]]
        times = [
            (r.before_ms, r.after_ms)
            for r in self.rows
            if r.before_ms is not None and r.after_ms is not None
        ]
        if times:
            before, after = (statistics.median(side) for side in zip(*times, strict=True))
            out.append(f"milliseconds, median: {before:.0f} then, {after:.0f} now")
        return out

    def save(self, file: Path) -> None:
        """As JSON. Raises OSError."""
        content = {
            "changes": self.changes,
            "passed": self.passed,
            "rows": [asdict(row) for row in self.rows],
        }
        file.write_text(json.dumps(content, indent=1, ensure_ascii=False), encoding="utf-8")


def replay(
    client: Client,
    folder: Path,
    entries: Iterable[Entry],
    changes: dict[str, Any] | None = None,
    progress: Callable[[int], None] = lambda done: None,
) -> ReplayReport:
    """Send every request again, with ``changes`` where its kind has such a field. Raises
    RecordingError, or what the client does when nobody answers."""
    report = ReplayReport({k: v for k, v in (changes or {}).items() if v is not None})
    for number, entry in enumerate(entries, start=1):
        report.rows.append(_again(client, folder, entry, report.changes))
        progress(number)
    return report


def _again(client: Client, folder: Path, entry: Entry, changes: dict[str, Any]) -> Replayed:
    images, mask = pictures_of(folder, entry)
    missing = [str(file) for file in (*images, *([mask] if mask else [])) if not file.exists()]
    if missing:
        raise RecordingError(f"{missing[0]}: a picture of the recording is not there")
    before_ms = _own_ms(entry.timings_ms)
    try:
        job: Job[Any] = client.run_job(entry.asked(**changes), list(images) or None, mask=mask)
    except DLOError as error:
        if not _of_the_job(error):
            raise
        verdict: Verdict = "still_fails" if entry.result is None else "broken"
        return Replayed(
            entry.id, entry.kind, verdict, float(entry.result is None), str(error), before_ms, None
        )
    after_ms = _own_ms(job.timings_ms)
    if entry.result is None:
        return Replayed(
            entry.id, entry.kind, "works_now", 0.0, "it is answered", before_ms, after_ms
        )
    assert job.result is not None
    alike, what = compared(entry.result, job.result.model_dump(mode="json"))
    return Replayed(
        entry.id, entry.kind, _verdict(entry, alike >= SAME_IOU), alike, what, before_ms, after_ms
    )


def _of_the_job(error: DLOError) -> bool:
    """Whether it is about this request: others are about the service, and end the replay."""
    return isinstance(error, JobFailed | InvalidRequest)


def _verdict(entry: Entry, same: bool) -> Verdict:
    if same:
        return "still_bad" if entry.outcome == "bad" else "same"
    if entry.outcome == "good":
        return "at_risk"
    return "may_be_mended" if entry.outcome == "bad" else "changed"


def _own_ms(timings: dict[str, float]) -> float | None:
    """What the job itself took, without its wait in the queue."""
    total = timings.get("total")
    return None if total is None else total - timings.get("queue_wait", 0.0)


def compared(before: dict[str, Any], after: dict[str, Any]) -> tuple[float, str]:
    """How alike two answers of one kind are, and in words what differs."""
    if before.get("kind") == "instances":
        return _instances(
            InstancesResult.model_validate(before), InstancesResult.model_validate(after)
        )
    shared = [name for name in before if name in after and name not in ("models", "warnings")]
    parts = {name: alikeness(before[name], after[name]) for name in shared}
    lowest = sorted(parts, key=lambda name: parts[name])[:3]
    differing = [f"{name} {100 * parts[name]:.0f} %" for name in lowest if parts[name] < 1]
    return min(parts.values(), default=1.0), "alike: " + ", ".join(
        differing
    ) if differing else "the same"


def _instances(before: InstancesResult, after: InstancesResult) -> tuple[float, str]:
    from dlo_client.labelling.corrections import compare

    if (before.width, before.height) != (after.width, after.height):
        return 0.0, f"is {after.width}×{after.height} now, was {before.width}×{before.height}"
    change = compare(label_of(before, "then"), label_of(after, "now"))
    parts = [
        f"{change.added} more" if change.added else "",
        f"{change.removed} fewer" if change.removed else "",
        f"{change.reordered} crossings reordered" if change.reordered else "",
        f"status {before.status.code} → {after.status.code}"
        if before.status.code != after.status.code
        else "",
    ]
    what = ", ".join(
        [f"instances IoU {100 * change.instance_iou:.1f} %", *(part for part in parts if part)]
    )
    return (0.0 if change.reordered else change.instance_iou), what


def alikeness(a: Any, b: Any) -> float:
    """1 for equal values, 0 for unlike ones; numbers by their relative difference, lists and
    objects by their worst."""
    if isinstance(a, bool) or isinstance(b, bool) or a is None or b is None:
        return float(a == b)
    if isinstance(a, int | float) and isinstance(b, int | float):
        size = max(abs(a), abs(b))
        return 1.0 if size < 1e-9 else max(0.0, 1.0 - abs(a - b) / size)
    if isinstance(a, dict) and isinstance(b, dict):
        return (
            min((alikeness(a[k], b[k]) for k in a.keys() & b.keys()), default=1.0)
            if a.keys() == b.keys()
            else 0.0
        )
    if isinstance(a, list) and isinstance(b, list):
        return (
            min((alikeness(x, y) for x, y in zip(a, b, strict=True)), default=1.0)
            if len(a) == len(b)
            else 0.0
        )
    return float(a == b)
