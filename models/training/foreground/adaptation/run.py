"""One adaptation from its pictures to a network and a report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import onnxruntime

from models.geometry.arrays import ByteArray, Float32Array
from models.segmentation.segment import ForegroundInput, segment
from models.training.foreground.adaptation.choice import (
    SHARES,
    Exam,
    Probability,
    Scores,
    best,
    refusal,
)
from models.training.foreground.adaptation.course import CourseParams, begun, step
from models.training.foreground.adaptation.sources import (
    Batches,
    Own,
    general_set,
    read_own,
    rehearsal,
)
from models.training.foreground.initial import refold
from models.training.foreground.real_pictures import Photograph
from models.training.log import Log
from models.training.state import Course

CHECKPOINT, NETWORK = "checkpoint.pt", "network.onnx"
_SAVE_EVERY_S = 20.0
_WORST = 4
_TRAINING_SHARE = 0.85
"""Of the progress; the rest is measuring."""


@dataclass(frozen=True)
class Report:
    """What came of it. Dice in percent; ``general_*`` on renders; ``share`` of what was learnt that
    was kept; ``refused``: why the network must not be used."""

    before: float
    after: float
    general_before: float
    general_after: float
    share: float
    refused: str | None
    pictures: int
    kept_aside: list[dict[str, object]]
    steps: int
    seconds: float


def adapt(
    folder: Path,
    parent: tuple[str, Path],
    fed: ForegroundInput,
    params: CourseParams,
    keep_aside: float,
    log: Log,
) -> Report:
    """``parent``: architecture and ONNX file; ``fed``: how it is fed. Writes network and overlays
    to ``folder``.

    Raises ValueError for pictures that cannot be learnt from, and for a parent of another
    architecture.
    """
    own = read_own(folder, keep_aside)
    course = _learnt(folder, own, begun(*parent, params), params, fed, log)
    exam = Exam(own.aside, general_set(params.general), fed.threshold)
    seen_before = _probability(parent[1].read_bytes(), fed)
    before = exam.scores(seen_before)
    files = {share: refold(parent[1], course.average, share) for share in SHARES}
    mixtures: dict[float, Scores] = {}
    for share, data in files.items():
        mixtures[share] = exam.scores(_probability(data, fed))
        log(progress=_TRAINING_SHARE + (1 - _TRAINING_SHARE) * len(mixtures) / len(files))
    share = best(before, mixtures)
    refused = refusal(before, mixtures[share])
    if refused is None:
        (folder / NETWORK).write_bytes(files[share])
    _draw_worst(folder, exam, mixtures[share], seen_before, _probability(files[share], fed))
    rows = zip(own.aside, before.aside, mixtures[share].aside, strict=True)
    return Report(
        before.mean,
        mixtures[share].mean,
        before.general_mean,
        mixtures[share].general_mean,
        share,
        refused,
        len(own.trains),
        [{"name": p.name, "before": b, "after": a} for p, b, a in rows],
        course.steps,
        course.seconds,
    )


def refolded(folder: Path, name: str, parent: Path, shares: Sequence[float]) -> dict[float, bytes]:
    """The mixtures of a run that has ended, from its checkpoint: ONNX files by the share of what
    was learnt."""
    course = begun(name, parent, CourseParams())
    course.restore(folder / CHECKPOINT)
    return {share: refold(parent, course.average, share) for share in shares}


def _learnt(
    folder: Path, own: Own, course: Course, params: CourseParams, fed: ForegroundInput, log: Log
) -> Course:
    course.restore(folder / CHECKPOINT)
    renders = rehearsal((params.height, params.width), params.renders)
    batches = Batches(
        own, renders, params.real, fed, np.random.default_rng([params.seed, course.steps])
    )
    saved = course.seconds
    while course.share() < 1:
        step(course, batches)
        if course.seconds - saved >= _SAVE_EVERY_S or course.share() == 1:
            saved = course.seconds
            course.save(folder / CHECKPOINT)
        log(progress=_TRAINING_SHARE * course.share())
    return course


def _probability(file: bytes, fed: ForegroundInput) -> Probability:
    session = onnxruntime.InferenceSession(file, providers=["CPUExecutionProvider"])
    (name,) = (i.name for i in session.get_inputs())

    def network(x: Float32Array) -> Float32Array:
        return np.asarray(session.run(None, {name: x})[0])

    return partial(segment, network=network, settings=fed)


def _draw_worst(
    folder: Path, exam: Exam, after: Scores, before: Probability, now: Probability
) -> None:
    for rank, k in enumerate(np.argsort(after.aside)[:_WORST], start=1):
        picture = exam.aside[int(k)]
        sides = [_compared(picture, exam, p) for p in (before, now)]
        cv2.imwrite(str(folder / f"worst_{rank}.png"), np.hstack(sides)[:, :, ::-1])


def _compared(picture: Photograph, exam: Exam, probability: Probability) -> ByteArray:
    found, true = exam.found(probability, picture.rgb), picture.labels == 255
    out = picture.rgb * 0.6
    for where, color in (
        (found & true, (0, 255, 0)),
        (found & ~true, (255, 0, 0)),
        (true & ~found, (0, 0, 255)),
    ):
        out[where] = 0.5 * out[where] + 0.5 * np.array(color)
    return out.astype(np.uint8)
