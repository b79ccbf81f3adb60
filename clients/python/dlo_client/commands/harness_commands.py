"""``dlo topology`` and ``dlo disentangle``: wire harnesses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from dlo_client.commands.app import AsJson, Images, Out, Threshold, app, process
from dlo_client.commands.printing import print_job_as_json, print_rows
from dlo_client.contracts import (
    ArmBase,
    DisentangleRequest,
    DisentangleResult,
    Earlier,
    Gripper,
    HarnessDrawing,
    Job,
    TopologyRequest,
    TopologyResult,
)
from dlo_client.errors import describe_fields
from dlo_client.outcomes import result_of

Drawing = Annotated[
    Path | None,
    typer.Option(
        exists=True, dir_okay=False, help="JSON of the harness drawing: names its branches."
    ),
]
Arm = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME:X,Y", help="Base of an arm in the picture's plane, px; twice or more."
    ),
]
GripperPx = Annotated[
    float | None,
    typer.Option(min=0.01, max=1e5, help="Room that the gripper needs beside the strand, px."),
]
Before = Annotated[
    Path | None,
    typer.Option(
        "--earlier",
        exists=True,
        dir_okay=False,
        help="result.json of the picture before, whose first action was carried out since.",
    ),
]
Masks = Annotated[
    bool, typer.Option("--masks", help="The pictures are masks: what is not background is DLO.")
]


@app.command()
def topology(
    context: typer.Context,
    images: Images,
    out: Out = None,
    drawing: Drawing = None,
    masks: Masks = False,
    threshold: Threshold = None,
    as_json: AsJson = False,
) -> None:
    """Find the sections, branch-points and crossings of wire harnesses."""
    request = TopologyRequest(
        drawing=None if drawing is None else _drawing(drawing),
        threshold=threshold,
        files=[] if out is None else ["overlay"],
    )
    process(
        context.obj, request, images, out, print_job_as_json if as_json else print_topology, masks
    )


@app.command()
def disentangle(
    context: typer.Context,
    images: Images,
    out: Out = None,
    arm: Arm = None,
    gripper_px: GripperPx = None,
    before: Before = None,
    masks: Masks = False,
    threshold: Threshold = None,
    as_json: AsJson = False,
) -> None:
    """Propose dual-arm moves that remove a crossing of a wire harness."""
    request = DisentangleRequest(
        arms=[_arm(text) for text in arm or []],
        gripper=None if gripper_px is None else Gripper(width_px=gripper_px),
        earlier=None if before is None else _earlier(before),
        threshold=threshold,
        files=[] if out is None else ["overlay"],
    )
    process(
        context.obj, request, images, out, print_job_as_json if as_json else print_actions, masks
    )


def _drawing(path: Path) -> HarnessDrawing:
    try:
        return HarnessDrawing.model_validate_json(path.read_bytes())
    except ValidationError as error:
        raise typer.BadParameter(
            f"{path}: {describe_fields(error)}", param_hint="--drawing"
        ) from error


def _earlier(path: Path) -> Earlier:
    try:
        result = DisentangleResult.model_validate_json(path.read_bytes())
    except ValidationError as error:
        raise typer.BadParameter(
            f"{path}: {describe_fields(error)}", param_hint="--earlier"
        ) from error
    if result.topology is None or not result.actions:
        raise typer.BadParameter(f"{path} has no topology or no action", param_hint="--earlier")
    return Earlier.model_validate({"topology": result.topology, "action": result.actions[0]})


def _arm(text: str) -> ArmBase:
    name, _, place = text.partition(":")
    try:
        x, y = (float(v) for v in place.split(","))
        return ArmBase(name=name, xy=(x, y))
    except ValueError as error:
        raise typer.BadParameter(f"{text}: expected NAME:X,Y", param_hint="--arm") from error


def print_topology(image: Path, job: Job[TopologyResult], saved: Sequence[Path]) -> None:
    result = result_of(job)
    counts = f"{len(result.sections)} sections, {len(result.branch_points)} branch-points"
    head = f"{image}: {result.width} x {result.height}, {counts}, {len(result.crossings)} crossings: {result.message}"
    rows = [
        [str(s.id), s.name or "", f"{s.width_px:.1f}", f"{s.length_px:.0f}", " - ".join(s.ends)]
        for s in result.sections
    ]
    print_rows(head, ["section", "name", "width px", "length px", "ends"], rows, job, saved)
    if result.match is not None:
        missing, extra = (
            ", ".join(result.match.missing) or "none",
            ", ".join(map(str, result.match.extra)) or "none",
        )
        typer.echo(
            f"  drawing: missing {missing}; extra sections {extra}; cost {result.match.cost:.2f}"
        )


def print_actions(image: Path, job: Job[DisentangleResult], saved: Sequence[Path]) -> None:
    result = result_of(job)
    head = f"{image}: {result.width} x {result.height}, {result.message}"
    rows = [
        [
            str(a.rank),
            str(a.crossing),
            str(a.section),
            f"{57.2958 * a.turn_rad:.0f}",
            str(a.crossings_after),
            f"{a.score:.2f}",
            a.hold.arm or "",
            a.pick.arm or "",
        ]
        for a in result.actions
    ]
    columns = ["rank", "crossing", "section", "turn deg", "left", "score", "holds", "moves"]
    print_rows(head, columns, rows, job, saved)
    if result.actions:
        typer.echo(f"  best: {result.actions[0].why}")
