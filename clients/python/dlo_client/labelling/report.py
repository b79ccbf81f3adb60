"""What became of a run: counts, failures with their reasons, and which labels to look at first."""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import asdict, dataclass, field
from pathlib import Path

from dlo_client.labelling.store import Entry, write_whole

FILE = "report.json"
SHOWN = 20


@dataclass(frozen=True)
class Report:
    """``failed``: name → why. ``duplicates``: name → the picture with the same bytes. ``changed``:
    labelled, but the file is another one by now. ``gone``: labelled before, no longer in the
    source. ``uncertain``: all labelled pictures, least certain first, with the reason. ``stopped``:
    why the run ended before its end, or None. ``skipped``: suffixes that are no picture's → how
    many files have them."""

    pictures: int
    labelled: int
    already: int
    seconds: float
    failed: dict[str, str]
    duplicates: dict[str, str]
    changed: list[str]
    gone: list[str]
    uncertain: list[tuple[str, float, str]]
    stopped: str | None = None
    skipped: dict[str, int] = field(default_factory=dict)

    @property
    def missing(self) -> int:
        """Pictures without a label that did not fail either: a stopped run has not come to them."""
        return self.pictures - self.labelled - self.already - len(self.failed)

    def save(self, folder: Path) -> Path:
        """As ``report.json`` in the output folder. Raises OSError."""
        file = folder / FILE
        write_whole(
            file,
            json.dumps(asdict(self), indent=1, ensure_ascii=False).encode(
                "utf-8", "surrogateescape"
            ),
        )
        return file

    def lines(self) -> list[str]:
        """For a person: at most 20 of each kind."""
        rate = (
            f", {self.labelled / self.seconds:.1f} a second"
            if self.seconds > 0 and self.labelled
            else ""
        )
        out = [
            f"{self.pictures} pictures: {self.labelled} labelled now{rate}, {self.already} before, "
            f"{len(self.failed)} failed, {self.missing} left"
        ]
        if self.stopped:
            out.append(f"stopped: {self.stopped}; the same command goes on from here")
        out += section("failed", [f"{name}: {why}" for name, why in self.failed.items()])
        out += section(
            "same bytes", [f"{name} = {other}" for name, other in self.duplicates.items()]
        )
        listed = [
            f"{count} {suffix}"
            for suffix, count in sorted(self.skipped.items(), key=lambda item: -item[1])
        ]
        out += [f"skipped, no pictures: {', '.join(listed)}"] if listed else []
        out += section("changed since they were labelled; run again", self.changed)
        out += section("labelled, but no longer in the source", self.gone)
        doubtful = [f"{name}: {why}" for name, certainty, why in self.uncertain if certainty < 1]
        return out + section("look at these first", doubtful)


def make_report(
    entries: dict[str, Entry],
    names: Collection[str],
    now: Collection[str],
    changed: list[str],
    seconds: float,
    stopped: str | None,
    skipped: dict[str, int] | None = None,
) -> Report:
    """``names``: the source's pictures; ``now``: those labelled in this run."""
    known = {name: entries[name] for name in names if name in entries}
    labelled = [entry for entry in known.values() if entry.state != "failed"]
    present = set(names)
    return Report(
        pictures=len(names),
        labelled=sum(entry.name in now for entry in labelled),
        already=sum(entry.name not in now for entry in labelled),
        seconds=round(seconds, 3),
        failed={e.name: e.detail for e in known.values() if e.state == "failed"},
        duplicates={e.name: e.detail for e in labelled if e.state == "duplicate"},
        changed=changed,
        gone=[name for name in entries if name not in present],
        uncertain=sorted(
            ((e.name, e.certainty, e.detail) for e in labelled if e.state == "done"),
            key=lambda item: item[1],
        ),
        stopped=stopped,
        skipped=skipped or {},
    )


def section(title: str, items: list[str], file: str = FILE) -> list[str]:
    """The first of them, under a title; ``file`` has them all."""
    if not items:
        return []
    more = [f"  … and {len(items) - SHOWN} more ({file})"] if len(items) > SHOWN else []
    return [f"{title}:", *(f"  {item}" for item in items[:SHOWN]), *more]
