"""``dlo adapt``: a network of one's own from a handful of labelled pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from dlo_client.client import Client
from dlo_client.commands.app import app
from dlo_client.commands.labelling_commands import readable_labels
from dlo_client.commands.labelling_formats import Tool
from dlo_client.commands.printing import print_error, print_lines
from dlo_client.commands.saving import save
from dlo_client.contracts import AdaptRequest, AdaptResult, Job, JobState
from dlo_client.outcomes import succeeded

_SHOWN = 10


@app.command()
def adapt(
    context: typer.Context,
    labels: Annotated[
        Path, typer.Argument(help="A folder that `dlo label` filled, or the file of another tool.")
    ],
    name: Annotated[str, typer.Option(help="Of the network; requests then name it as `model`.")],
    tool: Annotated[
        Tool | None, typer.Option("--format", help="Which tool the file is of.")
    ] = None,
    pictures: Annotated[
        str | None, typer.Option(help="Where the pictures are; needed with --format.")
    ] = None,
    minutes: Annotated[float, typer.Option(min=0.01, max=45, help="Of learning.")] = 8.0,
    parent: Annotated[
        str | None, typer.Option(help="Network to begin from; default: the service's.")
    ] = None,
    use: Annotated[
        bool, typer.Option("--use", help="Let the name stand for it, if it is accepted.")
    ] = False,
    everything: Annotated[
        bool, typer.Option("--all", help="Also labels that nobody corrected.")
    ] = False,
    classes: Annotated[
        list[str] | None, typer.Option("--label", help="What a cable is called in the file.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder for the worst overlays.")
    ] = None,
) -> None:
    """Adapt a network to a place from 5 to 500 labelled pictures; on a service with a worker that
    trains."""
    client: Client = context.obj
    with readable_labels():
        archive = _archive(labels, tool, pictures, everything, classes or ["dlo"])
        request = AdaptRequest(
            name=name,
            labels=client.upload_labels(archive),
            parent=parent,
            minutes=minutes,
            use=use,
            timeout_s=3600,
        )
        job = succeeded(_followed(client, client.submit(request)))
        assert job.result is not None
        files = save(client, job, out, name) if out else []
    print_lines(described(job.result, minutes))
    print_lines(f"wrote {file}" for file in files)
    if not job.result.accepted:
        raise typer.Exit(1)


def _archive(
    labels: Path, tool: Tool | None, pictures: str | None, everything: bool, classes: list[str]
) -> bytes:
    from dlo_client.labelling.adaptation import pack_foreign, pack_store
    from dlo_client.labelling.formats import Wanted

    if tool is None:
        packed = pack_store(labels, pictures, everything=everything)
    elif pictures is None:
        raise ValueError("--format needs --pictures: the file does not hold them")
    else:
        packed = pack_foreign(labels, tool.value, pictures, Wanted(frozenset(classes)))
    for picture, why in packed.problems.items():
        print_error(f"{picture}: left out: {why}")
    print_lines([f"{len(packed.names)} labelled pictures"])
    return packed.archive


def _followed(client: Client, job: Job[AdaptResult]) -> Job[Any]:
    """The job once it has ended; Ctrl-C cancels it."""
    try:
        with typer.progressbar(length=100, label=f"adapting (job {job.id})") as bar:
            for event in client.events(job):
                bar.update(round(100 * event.progress) - bar.pos)
    except KeyboardInterrupt:
        client.cancel(job)
        print_error("cancelled; the same command goes on where it was")
        raise typer.Exit(1) from None
    ended = client.get(job)
    if ended.state is JobState.CANCELLED:
        print_error("cancelled; the same command goes on where it was")
        raise typer.Exit(1)
    return ended


def described(result: AdaptResult, minutes: float) -> list[str]:
    """For a person."""
    lines = [
        f"Dice on {len(result.kept_aside)} pictures kept aside: {result.before.dice:.1f} before, "
        f"{result.after.dice:.1f} after; on other places {result.general.before:.1f} and {result.general.after:.1f}",
        *(
            f"  {row.name}: {row.before:.1f} → {row.after:.1f}"
            for row in result.kept_aside[:_SHOWN]
        ),
        *(f"note: {warning}" for warning in result.warnings),
    ]
    if not result.accepted:
        return [*lines, f"not accepted: {result.refused}", "nothing was stored"]
    model = f"{result.model}@{result.version}"
    if result.in_service:
        return [*lines, f"stored as {model}; `model: {result.model}` names it"]
    return [
        *lines,
        f"stored as {model}; put it into service with: dlo models use {result.model} {result.version}",
    ]
