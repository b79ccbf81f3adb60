"""DLO-WSL (thesis 2.5): pictures at known poses and one stroke of a tracked pen a DLO, to labels of
all pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from models.geometry.arrays import ByteArray, FloatArray
from models.geometry.cameras import Camera
from models.tracked_labels.correction import (
    CorrectedStroke,
    CorrectionParams,
    CropReader,
    correct_strokes,
)
from models.tracked_labels.ends import EndParams, settle_ends
from models.tracked_labels.outlines import (
    Strand,
    StrandCrossing,
    draw_ids,
    find_crossings,
    strand_of,
)
from models.tracked_labels.strokes import ProjectedStroke, project_stroke, smooth_stroke, stretches


@dataclass(frozen=True)
class TrackedParams:
    """``spacing_px``: distance of corrected points in the nearest view; ``hand_m``: how far the
    spline may miss the pen's points; ``measured``: share of the crops in the width (0: the
    thickness as given); ``ends``: how the ends are found (None: as the pen marked them)."""

    spacing_px: float = 8.0
    hand_m: float = 0.002
    measured: float = 0.7
    correct: bool = True
    correction: CorrectionParams = field(default_factory=CorrectionParams)
    ends: EndParams | None = field(default_factory=EndParams)


@dataclass(frozen=True, eq=False)
class TrackedView:
    """One picture: per stroke its :class:`Strand` (None: out of the picture) and its correction;
    ``ids`` (H, W)."""

    strands: tuple[Strand | None, ...]
    corrections: tuple[CorrectedStroke, ...]
    crossings: tuple[StrandCrossing, ...]
    ids: ByteArray


def label_tracked(
    images: Sequence[ByteArray],
    cameras: Sequence[Camera],
    strokes_m: Sequence[FloatArray],
    thickness_m: Sequence[float],
    reader: CropReader,
    params: TrackedParams,
) -> list[TrackedView]:
    """``images`` (H, W, 3) with their ``cameras``; a stroke (k, 3) and a thickness (diameter) for
    each DLO.

    Raises StrokeError for a stroke that is no line.
    """
    samples = [
        smooth_stroke(s, _step(s, cameras, params.spacing_px), params.hand_m) for s in strokes_m
    ]
    if params.correct:
        corrected = correct_strokes(
            images, cameras, samples, thickness_m, reader, params.correction
        )
        if params.ends is not None:
            corrected = _ended(images, cameras, corrected, thickness_m, params.ends)
    else:
        corrected = [
            [_as_projected(project_stroke(s, camera)) for s in samples] for camera in cameras
        ]
    views = []
    for image, camera, row in zip(images, cameras, corrected, strict=True):
        measured = params.measured if params.correct else 0.0
        size = (camera.intrinsics.width, camera.intrinsics.height)
        strands = [
            strand_of(c, t, camera.focal_px, size, measured)
            for c, t in zip(row, thickness_m, strict=True)
        ]
        ids = draw_ids(strands, *image.shape[:2])
        views.append(TrackedView(tuple(strands), tuple(row), tuple(find_crossings(strands)), ids))
    return views


def _ended(
    images: Sequence[ByteArray],
    cameras: Sequence[Camera],
    corrected: Sequence[Sequence[CorrectedStroke]],
    thickness_m: Sequence[float],
    params: EndParams,
) -> list[list[CorrectedStroke]]:
    """Per view, per stroke: both ends where the pictures show them."""
    strokes = []
    for in_views, thick in zip(zip(*corrected, strict=True), thickness_m, strict=True):
        widths = [
            thick * camera.focal_px / s.depth_m for camera, s in zip(cameras, in_views, strict=True)
        ]
        strokes.append(settle_ends(images, in_views, widths, params))
    return [list(row) for row in zip(*strokes, strict=True)]


def _step(points_m: FloatArray, cameras: Sequence[Camera], spacing_px: float) -> float:
    """Meters along the stroke that are ``spacing_px`` in the view that sees it largest."""
    points = np.asarray(points_m, np.float64).reshape(-1, 3)
    scales = []
    for camera in cameras:
        depth = camera.in_camera(points)[:, 2]
        scales += [camera.focal_px / float(depth[depth > 0].min())] if (depth > 0).any() else []
    return spacing_px / max(scales, default=1e3)


def _as_projected(seen: ProjectedStroke) -> CorrectedStroke:
    """The thesis's comparison: the spline, not corrected."""
    known = np.zeros(len(seen.xy), bool)
    for run in stretches(seen.inside):
        known[run] = True
    offset = np.where(known, 0.0, np.nan)
    return CorrectedStroke(seen.xy, offset, np.ones(len(known)), np.ones(len(known)), seen.depth_m)
