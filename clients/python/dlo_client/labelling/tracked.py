"""Labels of tracked strokes, filed like those of a batch: the same folder, formats and
corrections."""

from __future__ import annotations

from collections.abc import Sequence

from dlo_client.contracts import LabelTrackedResult
from dlo_client.contracts.labelling import TrackedLabels
from dlo_client.labelling.labels import LabelledInstance, PictureLabel
from dlo_client.labelling.store import Entry, LabelStore


def file_tracked(
    store: LabelStore, result: LabelTrackedResult, names: Sequence[str]
) -> list[PictureLabel]:
    """One label a view under ``names``, into a store that is open for writing. Raises
    StoreError."""
    labels = [_label(view, name, result) for view, name in zip(result.views, names, strict=True)]
    for label in labels:
        store.put(Entry(label.name, "done", detail=label.doubt, certainty=label.certainty), label)
    return labels


def _label(view: TrackedLabels, name: str, result: LabelTrackedResult) -> PictureLabel:
    instances = [
        LabelledInstance(
            id=item.id,
            score=item.score,
            centerline_xy=item.centerline_xy,
            width_px=item.width_px,
            mask_rle=item.mask_rle,
            endpoints=item.endpoints,
        )
        for item in view.instances
    ]
    return PictureLabel(
        name=name,
        width=view.width,
        height=view.height,
        instances=instances,
        crossings=view.crossings,
        origin="tracked",
        models=result.models,
    )
