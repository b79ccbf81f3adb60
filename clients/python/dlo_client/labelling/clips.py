"""A clip of pictures is labelled from the pictures of it that somebody has corrected. Needs
``dlo-client[label]``.

The first run follows what the service finds from the first picture on. Once a picture is corrected
in the folder, the same call follows the cables of that label instead, forward and backward; with
several of them, every picture gets its label from the nearest one. The pictures of a video are
written to ``pictures`` in the folder, where the corrector finds them.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from dlo_client.client import Client
from dlo_client.contracts import InstancesRequest, TrackState
from dlo_client.labelling.labels import PictureLabel
from dlo_client.labelling.propagation import label_of_frame, track_of
from dlo_client.labelling.report import Report
from dlo_client.labelling.sources import (
    VIDEOS,
    Found,
    PictureUnreadable,
    SourcePicture,
    find_pictures,
    read_still,
)
from dlo_client.labelling.store import Entry, LabelStore, corrected_file, read_label, write_whole
from dlo_client.video import shots

PICTURES = "pictures"
Progress = Callable[[int, int, int], None]


class _Way(NamedTuple):
    """Pictures in the order in which they are followed, from the label of one that is corrected, or
    from nothing."""

    start: PictureLabel | None
    indices: Sequence[int]


def label_clip(
    source: str,
    out: Path,
    client: Client,
    request: InstancesRequest,
    *,
    every: int = 1,
    progress: Progress,
) -> Report:
    """Label every ``every``-th picture of a video, or of a folder in the order of names, into the
    folder ``out``.

    Raises SourceError, StoreError; ValueError for a corrected label that cannot be followed.
    """
    started = time.monotonic()
    with LabelStore(out, write=True) as store:
        store.remember(
            {"kind": "clip", "every": every} | request.model_dump(mode="json", include=_WITH)
        )
        pictures = _pictures(source, out, every)
        store.remember_source(pictures.source)
        corrected = _corrected(out, pictures)
        _follow(store, client, request, pictures, corrected, progress)
        report = _report(store, pictures, corrected, time.monotonic() - started)
        report.save(out)
    return report


_WITH = {"method", "model", "threshold", "effort"}


def _pictures(source: str, out: Path, every: int) -> Found:
    """Those of a folder, or of a video once they are written."""
    if Path(source).suffix.lower() not in VIDEOS:
        found = find_pictures(source, skip=out)
        return Found(found[::every], found.source, found.skipped)
    folder = out / PICTURES
    frames, _ = shots(source, every)
    for shot in frames:
        file = folder / f"{shot.name}.png"
        if not file.exists():
            write_whole(file, shot.data)
    return find_pictures(folder)


def _corrected(out: Path, pictures: Sequence[SourcePicture]) -> dict[int, PictureLabel]:
    """By the picture's place in the clip, what somebody has confirmed."""
    files = ((k, corrected_file(out, picture.name)) for k, picture in enumerate(pictures))
    return {k: read_label(file) for k, file in files if file.exists()}


def _follow(
    store: LabelStore,
    client: Client,
    request: InstancesRequest,
    pictures: Sequence[SourcePicture],
    corrected: dict[int, PictureLabel],
    progress: Progress,
) -> None:
    for k, label in corrected.items():
        entry = Entry(
            pictures[k].name, "done", sha256=label.sha256 or "", certainty=1.0, detail="corrected"
        )
        store.put(entry, label)
    done, failed = len(corrected), 0
    for way in _ways(len(pictures), corrected):
        state = TrackState() if way.start is None else track_of(way.start)
        known = frozenset(cable.id for cable in state.cables)
        for k in way.indices:
            try:
                state = _labelled(store, client, request, pictures[k], state, known)
            except PictureUnreadable as error:
                failed += 1
                store.put(Entry(pictures[k].name, "failed", detail=str(error)))
            done += 1
            progress(done, failed, len(pictures))


def _labelled(
    store: LabelStore,
    client: Client,
    request: InstancesRequest,
    picture: SourcePicture,
    state: TrackState,
    known: frozenset[int],
) -> TrackState:
    """File the label of the next picture of a track; returns the track after it. Raises
    PictureUnreadable."""
    data, stamp = read_still(picture)
    result = client.run(request.model_copy(update={"previous": state}), data)
    sha256 = hashlib.sha256(data).hexdigest()
    label = label_of_frame(result, picture.name, sha256, known)
    store.put(Entry(label.name, "done", stamp, sha256, label.doubt, label.certainty), label)
    return result.track or state


def _ways(count: int, corrected: dict[int, PictureLabel]) -> Iterator[_Way]:
    """Every picture that is not corrected once, from the nearest one that is."""
    if not corrected:
        yield _Way(None, range(count))
        return
    places = sorted(corrected)
    nearest = [min(places, key=lambda place: abs(place - k)) for k in range(count)]
    for place in places:
        yield _Way(corrected[place], [k for k in range(place + 1, count) if nearest[k] == place])
        yield _Way(corrected[place], [k for k in range(place - 1, -1, -1) if nearest[k] == place])


def _report(
    store: LabelStore, pictures: Found, corrected: dict[int, PictureLabel], seconds: float
) -> Report:
    entries = store.entries()
    here = {picture.name for picture in pictures}
    failed = {e.name: e.detail for e in entries.values() if e.name in here and e.state == "failed"}
    doubtful = sorted(
        (e.certainty, e.name, e.detail) for e in entries.values() if e.name in here - failed.keys()
    )
    return Report(
        pictures=len(pictures),
        labelled=len(pictures) - len(corrected) - len(failed),
        already=len(corrected),
        seconds=round(seconds, 3),
        failed=failed,
        duplicates={},
        changed=[],
        gone=sorted(entries.keys() - here),
        uncertain=[(name, certainty, detail) for certainty, name, detail in doubtful],
        skipped=pictures.skipped,
    )
