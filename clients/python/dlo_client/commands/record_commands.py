"""``dlo record`` and ``dlo replay``: a cell's requests in a folder, and the folder on another
version or network."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, cast

import typer
from pydantic import TypeAdapter

from dlo_client.client import Client
from dlo_client.commands.app import app, described
from dlo_client.commands.labelling_commands import readable_labels
from dlo_client.commands.printing import print_error, print_lines
from dlo_client.contracts import AnyRequest, JobRequest
from dlo_client.errors import JobFailed
from dlo_client.recording import (
    Entry,
    Outcome,
    Recorder,
    RecordingError,
    note_outcome,
    read_recording,
)
from dlo_client.replay import replay as replay_recording

Folder = Annotated[Path, typer.Argument(file_okay=False, help="Of the recording.")]


@app.command()
def record(
    context: typer.Context,
    folder: Folder,
    images: Annotated[list[Path], typer.Argument(metavar="IMAGE...", help="A request each.")],
    request: Annotated[
        str, typer.Option(help="JSON of the request, or @FILE.")
    ] = '{"kind": "instances"}',
    outcome: Annotated[
        str | None, typer.Option(help="good or bad: whether the cell could use the answers.")
    ] = None,
) -> None:
    """Run a request for every picture and keep requests, pictures and answers in a folder, for `dlo
    replay`."""
    client: Client = context.obj
    with readable_labels():
        if outcome not in (None, "good", "bad"):
            raise ValueError(f"--outcome is good or bad, not {outcome}")
        text = Path(request[1:]).read_text(encoding="utf-8") if request.startswith("@") else request
        asked = cast(JobRequest[Any], TypeAdapter(AnyRequest).validate_python(json.loads(text)))
        recorder = Recorder(client, folder)
        failed = False
        for image in images:
            try:
                entry, _ = recorder.run(asked, image)
            except JobFailed as error:
                print_error(f"{image}: {described(error)}")
                failed = True
                continue
            if outcome is not None:
                recorder.outcome(entry, cast(Outcome, outcome))
            print_lines([f"{image}: recorded as {entry}"])
    if failed:
        raise typer.Exit(1)


@app.command()
def outcome(
    folder: Folder,
    entry: Annotated[str, typer.Argument(help="As `dlo record` printed it.")],
    what: Annotated[
        str, typer.Argument(help="good or bad: whether the cell could use the answer.")
    ],
    note: Annotated[str | None, typer.Option(help="Why.")] = None,
) -> None:
    """Note what became of a recorded answer."""
    with readable_labels():
        if what not in ("good", "bad"):
            raise ValueError(f"an outcome is good or bad, not {what}")
        if entry not in {one.id for one in _entries(folder)}:
            raise ValueError(f"{folder}: no request of it has the id {entry}")
        note_outcome(folder, entry, cast(Outcome, what), note)


@app.command()
def replay(
    context: typer.Context,
    folder: Folder,
    model: Annotated[
        str | None, typer.Option(help="Network in place of the one that was asked for.")
    ] = None,
    effort: Annotated[
        str | None, typer.Option(help="fast, normal or thorough instead of what was asked.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(dir_okay=False, help="JSON file for the report.")
    ] = None,
) -> None:
    """Send a recording again and report what changed, what is at risk, what may be mended, and the
    speed.

    Exit code 1 when an answer that the cell could use is another one now, or fails.
    """
    client: Client = context.obj
    with readable_labels():
        entries = _entries(folder)
        with typer.progressbar(length=len(entries), label="replaying") as bar:
            try:
                found = replay_recording(
                    client,
                    folder,
                    entries,
                    {"model": model, "effort": effort},
                    lambda _: bar.update(1),
                )
            except RecordingError as error:
                raise ValueError(str(error)) from error
        if report is not None:
            found.save(report)
        print_lines(found.lines())
    if not found.passed:
        raise typer.Exit(1)


def _entries(folder: Path) -> list[Entry]:
    try:
        return read_recording(folder)
    except RecordingError as error:
        raise ValueError(str(error)) from error
