"""Corrections that come back from a labelling tool, and how much they changed. Needs
``dlo-client[label]``."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from dlo_client.labelling.formats.exchange import Imported
from dlo_client.labelling.formats.pixels import Mask, decode
from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.matching import Pictures
from dlo_client.labelling.report import SHOWN, section
from dlo_client.labelling.store import (
    CORRECTED,
    LabelStore,
    StoreError,
    corrected_file,
    write_whole,
)

_SAME_IOU = 0.5
"""Two instances with less in common are different DLOs."""
_UNCHANGED_IOU = 0.999
FILE = "import_report.json"


@dataclass(frozen=True)
class Change:
    """What a correction did to one picture. ``iou``: foreground before and after; ``instance_iou``:
    mean over the DLOs of either, 0 for one that was added or removed; ``moved``: kept, with another
    mask; ``reordered``: crossings with the other strand on top."""

    name: str
    iou: float
    instance_iou: float
    kept: int
    moved: int
    added: int
    removed: int
    reordered: int

    @property
    def untouched(self) -> bool:
        return self.moved + self.added + self.removed + self.reordered == 0


@dataclass
class CorrectionReport:
    """``changes`` of the pictures whose correction was taken; ``problems``: name → why it was not;
    ``not_annotated``: name → why there was none; ``notes``: what was left out or changed on the way
    → picture → how often."""

    changes: list[Change] = field(default_factory=list)
    problems: dict[str, str] = field(default_factory=dict)
    not_annotated: dict[str, str] = field(default_factory=dict)
    notes: dict[str, dict[str, int]] = field(default_factory=dict)

    def lines(self) -> list[str]:
        """For a person, the most changed first; of each kind at most 20."""
        touched = [c for c in self.changes if not c.untouched]
        out = [
            f"{len(self.changes)} pictures came back, {len(touched)} of them changed, {len(self.problems)} refused, "
            f"{len(self.not_annotated)} not annotated"
        ]
        if self.changes:
            mean = np.mean([c.instance_iou for c in self.changes])
            out.append(f"instances before and after have a mean IoU of {100 * mean:.1f} %")
        out += [
            f"  {c.name}: IoU {100 * c.instance_iou:.1f} %, {c.moved} moved, {c.added} added, {c.removed} removed, "
            f"{c.reordered} crossings reordered"
            for c in sorted(touched, key=lambda c: c.instance_iou)[:SHOWN]
        ]
        out += section("refused", [f"{name}: {why}" for name, why in self.problems.items()], FILE)
        out += section(
            "not annotated", [f"{name}: {why}" for name, why in self.not_annotated.items()], FILE
        )
        for what, pictures in self.notes.items():
            of = ", ".join(list(pictures)[:SHOWN]) + (
                f" and more ({FILE})" if len(pictures) > SHOWN else ""
            )
            out.append(f"{what}: {sum(pictures.values())} in {len(pictures)} pictures: {of}")
        return out

    def save(self, folder: Path) -> None:
        """All of it, as ``import_report.json``. Raises OSError."""
        content = json.dumps(asdict(self), indent=1, ensure_ascii=False)
        write_whole(folder / FILE, content.encode("utf-8", "surrogatepass"))


def take_corrections(store: LabelStore, imported: Imported) -> CorrectionReport:
    """File every imported label that somebody confirmed under ``corrected/`` beside the service's
    own.

    A label is refused and named when its picture is not known, not told apart from another one, of
    another size, or meant by a second label too. Raises StoreError when the folder takes nothing
    more.
    """
    report = CorrectionReport(
        [], dict(imported.problems), dict(imported.not_annotated), imported.notes
    )
    for name, labels in _by_picture(store, imported.labels, report).items():
        if len(labels) > 1:
            both = ", ".join(label.name for label in labels[:3])
            report.problems |= {
                label.name: f"{len(labels)} labels are of {name} ({both})" for label in labels
            }
            continue
        (label,) = labels
        try:
            before = store.label(name)
            if (before.width, before.height) != (label.width, label.height):
                raise StoreError(
                    f"is {label.width}×{label.height}, the picture {before.width}×{before.height}"
                )
            after = label.model_copy(
                update={"name": name, "sha256": before.sha256, "origin": CORRECTED}
            )
            write_whole(corrected_file(store.folder, name), after.model_dump_json().encode())
            report.changes.append(compare(before, after))
        except StoreError as error:
            report.problems[label.name] = str(error)
        except OSError as error:
            report.problems[label.name] = f"cannot be filed: {error.strerror}"
    return report


def _by_picture(
    store: LabelStore, labels: Iterable[PictureLabel], report: CorrectionReport
) -> dict[str, list[PictureLabel]]:
    """The confirmed labels by the picture that they are of."""
    pictures = Pictures(store.entries())
    found: dict[str, list[PictureLabel]] = {}
    for label in labels:
        if label.origin != CORRECTED:
            report.not_annotated[label.name] = f"nobody confirmed it: its origin is {label.origin}"
            continue
        try:
            found.setdefault(pictures.find(label), []).append(label)
        except StoreError as error:
            report.problems[label.name] = str(error)
    return found


def compare(before: PictureLabel, after: PictureLabel) -> Change:
    """Both of the same size. Instances belong together greedily, the most alike first."""
    old, new = ([decode(i.mask_rle) for i in label.instances] for label in (before, after))
    pairs = _matched(old, new)
    overlaps = [iou for _, _, iou in pairs]
    every = len(old) + len(new) - len(pairs)
    return Change(
        name=after.name,
        iou=_iou(_union(old, before), _union(new, before)),
        instance_iou=float(sum(overlaps) / every) if every else 1.0,
        kept=len(pairs),
        moved=sum(iou < _UNCHANGED_IOU for iou in overlaps),
        added=len(new) - len(pairs),
        removed=len(old) - len(pairs),
        reordered=_reordered(
            before, after, {before.instances[i].id: after.instances[j].id for i, j, _ in pairs}
        ),
    )


def _matched(old: list[Mask], new: list[Mask]) -> list[tuple[int, int, float]]:
    candidates = [(_iou(a, b), i, j) for i, a in enumerate(old) for j, b in enumerate(new)]
    pairs: list[tuple[int, int, float]] = []
    for iou, i, j in sorted(candidates, reverse=True):
        if iou >= _SAME_IOU and all(i != p and j != q for p, q, _ in pairs):
            pairs.append((i, j, iou))
    return pairs


def _iou(a: Mask, b: Mask) -> float:
    either = int((a | b).sum())
    return float((a & b).sum() / either) if either else 1.0


def _union(masks: list[Mask], label: PictureLabel) -> Mask:
    out = np.zeros((label.height, label.width), bool)
    for mask in masks:
        out |= mask
    return out


def _reordered(before: PictureLabel, after: PictureLabel, same: Mapping[int, int]) -> int:
    """Crossings of the same two DLOs at nearly the same place whose order is turned."""
    count = 0
    for old in before.crossings:
        over, under = same.get(old.over.instance), same.get(old.under.instance)
        count += any(
            (new.over.instance, new.under.instance) == (under, over)
            and np.hypot(new.xy[0] - old.xy[0], new.xy[1] - old.xy[1]) < 15
            and over != under
            for new in after.crossings
        )
    return count
