"""Contracts to test with: two cables that cross in a small picture, the horizontal one on top."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import numpy as np
from dlo_client.contracts import (
    AnyJob,
    Crossing,
    Endpoint,
    FieldProblem,
    FileRef,
    Instance,
    InstancesResult,
    Job,
    JobState,
    MaskRLE,
    ModelUsed,
    NetworkInfo,
    NoopResult,
    Point,
    Problem,
    SceneStatus,
    Spline,
    StrandPosition,
)

from models.geometry.rle import encode

WIDTH, HEIGHT = 160, 120
JOB_ID = "0123456789abcdef0123456789abcdef"
SHA = "a" * 64
OVERLAY = b"the overlay's bytes"


def job(state: JobState = JobState.SUCCEEDED, **fields: Any) -> AnyJob:
    """A job; one that succeeded has held a worker, unless ``fields`` say otherwise."""
    if state is JobState.SUCCEEDED:
        fields = {"result": NoopResult(held_s=0.0)} | fields
    defaults = {
        "id": JOB_ID,
        "kind": "noop",
        "priority": "interactive",
        "created_at": datetime.now(UTC),
    }
    return AnyJob(**(defaults | {"state": state, "progress": float(state.final)} | fields))


def failed(problem: Problem) -> AnyJob:
    return job(JobState.FAILED, problem=problem)


def instances_job() -> Job[InstancesResult]:
    files = [FileRef(name="overlay.png", media_type="image/png", bytes=len(OVERLAY), sha256=SHA)]
    timings = {"segment": 31.5, "instances": 8.25, "instances.paths": 2.0, "total": 40.0}
    fields = {"kind": "instances", "result": two_cables(), "files": files, "timings_ms": timings}
    return Job[InstancesResult].model_validate(job(**fields).model_dump())


def two_cables() -> InstancesResult:
    return InstancesResult(
        width=WIDTH,
        height=HEIGHT,
        method="rt_dlo",
        status=SceneStatus(code="ok", limit=0.8, reasons=[]),
        threshold=0.5,
        instances=[
            _straight(1, (10.0, 60.0), (159.0, 60.0), ["free", "border"]),
            _straight(2, (80.0, 10.0), (80.0, 110.0), ["free", "hidden"]),
        ],
        crossings=[
            Crossing(
                id=1,
                xy=(80.0, 60.0),
                over=StrandPosition(instance=1, u=70 / 149),
                under=StrandPosition(instance=2, u=0.5),
                score=0.9,
            )
        ],
        models=[ModelUsed(name="foreground", version="1", sha256=SHA[:12])],
    )


def refused(status: int, code: str = "invalid_request", **fields: Any) -> Problem:
    return Problem(title="Refused", status=status, detail="it was refused", code=code, **fields)


def bad_threshold() -> Problem:
    return refused(422, errors=[FieldProblem(field="threshold", message="must be at most 1")])


def network() -> NetworkInfo:
    return NetworkInfo(
        name="foreground_compact",
        version="1",
        task="foreground",
        default=True,
        sha256=SHA,
        bytes=31_000_000,
        parameters=7_000_000,
        input="RGB",
        origin="trained here",
        license="Apache-2.0",
        metrics={"iou": 0.61},
    )


def _straight(number: int, start: Point, end: Point, ends: list[Any]) -> Instance:
    mask = _band(start, end)
    length = float(np.hypot(end[0] - start[0], end[1] - start[1]))
    return Instance(
        id=number,
        score=0.95,
        centerline_xy=[start, end],
        width_px=7.0,
        length_px=length,
        closed=False,
        spline=Spline(degree=1, knots=[0, 0, 1, 1], control_xy=[start, end]),
        endpoints=[Endpoint(xy=xy, kind=kind) for xy, kind in zip((start, end), ends, strict=True)],
        mask_rle=MaskRLE(size=(HEIGHT, WIDTH), counts=encode(mask)),
    )


def _band(start: Point, end: Point) -> np.ndarray:
    """The pixels within 3 of a horizontal or vertical segment; the horizontal one owns the
    crossing."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    near = (abs(x - x.clip(start[0], end[0])) <= 3) & (abs(y - y.clip(start[1], end[1])) <= 3)
    return near if start[1] == end[1] else near & (abs(y - 60) > 3)
