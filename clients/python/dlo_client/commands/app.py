"""The commands of ``dlo``: they speak HTTP through the client, print, and save files. See ``dlo
--help``.

Exit code 0; 1 with a readable problem on the error stream; 2 for a command line that is none. A bad
picture does not keep the next one from being processed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from typer.core import TyperGroup

from dlo_client.client import Client
from dlo_client.commands.printing import (
    print_error,
    print_instances,
    print_job_as_json,
    print_jobs,
    print_segment,
)
from dlo_client.commands.saving import save, stems
from dlo_client.connection import CONNECTION, DEFAULT_URL, KEY_VARIABLE, URL_VARIABLE, Connection
from dlo_client.contracts import (
    InstancesRequest,
    Job,
    JobKind,
    JobRequest,
    JobState,
    SegmentRequest,
)
from dlo_client.contracts.base import ResultT
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod
from dlo_client.errors import ConnectionFailed, DLOError, Unauthorized, describe_fields
from dlo_client.version import __version__

EXIT_CODES = (
    "Exit code: 0 all went well, 1 something failed (the error stream says what), 2 wrong options."
)


class _Readable(TyperGroup):
    """Every command ends with one line about what went wrong, whoever raised it."""

    def invoke(self, ctx: Any) -> Any:  # click's Context, of whichever click this typer uses
        with readable():
            return super().invoke(ctx)


app = typer.Typer(
    cls=_Readable,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    epilog=EXIT_CODES,
)

Images = Annotated[list[Path], typer.Argument(metavar="IMAGE", help="Pictures to look at.")]
Out = Annotated[
    Path | None,
    typer.Option(file_okay=False, help="Folder for the results, named after each picture."),
]
Threshold = Annotated[
    float | None,
    typer.Option(min=0, max=1, help="Foreground threshold; default: the network's own."),
]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print one JSON object a line instead of tables.")
]
Show = Callable[[Path, Job[ResultT], Sequence[Path]], None]


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"dlo {__version__}")
        raise typer.Exit


@app.callback()
def connect(
    context: typer.Context,
    url: Annotated[
        str | None, typer.Option(envvar=URL_VARIABLE, help=f"The service; default {DEFAULT_URL}.")
    ] = None,
    key: Annotated[str | None, typer.Option(envvar=KEY_VARIABLE, help="API key.")] = None,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version and end."
        ),
    ] = False,
) -> None:
    """Find cables, wires, hoses and ropes in pictures, with a running DLO service."""
    # The context's object is the client's transport: tests hand one in, otherwise it is None.
    context.meta[CONNECTION] = Connection(url, key, context.obj)
    context.obj = context.with_resource(Client(url, key, transport=context.obj))


@app.command()
def instances(
    context: typer.Context,
    images: Images,
    out: Out = None,
    method: Annotated[
        InstanceMethod, typer.Option(help="How instances are told apart.")
    ] = DEFAULT_METHOD,
    threshold: Threshold = None,
    points: Annotated[
        int | None,
        typer.Option(min=2, max=2000, help="Centerline points an instance; default: every 5 px."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Find every cable: centerline, width, ends, crossings and which cable is on top."""
    request = InstancesRequest(
        method=method,
        threshold=threshold,
        points_per_instance=points,
        files=[] if out is None else ["instances", "overlay"],
    )
    process(context.obj, request, images, out, print_job_as_json if as_json else print_instances)


@app.command()
def segment(
    context: typer.Context,
    images: Images,
    out: Out = None,
    threshold: Threshold = None,
    as_json: AsJson = False,
) -> None:
    """Tell cable from background: the share of cable pixels, and mask.png in the folder."""
    request = SegmentRequest(threshold=threshold)
    process(context.obj, request, images, out, print_job_as_json if as_json else print_segment)


@app.command()
def jobs(
    context: typer.Context,
    state: Annotated[JobState | None, typer.Option(help="Only jobs in this state.")] = None,
    kind: Annotated[JobKind | None, typer.Option(help="Only jobs of this kind.")] = None,
    limit: Annotated[int, typer.Option(min=1, help="At most so many.")] = 20,
) -> None:
    """List recent jobs, newest first."""
    client: Client = context.obj
    print_jobs(list(islice(client.jobs(state=state, kind=kind, page_size=min(limit, 100)), limit)))


@app.command()
def cancel(
    context: typer.Context,
    job_id: Annotated[str, typer.Argument(metavar="ID", help="Id of the job.")],
) -> None:
    """Cancel a queued or running job."""
    client: Client = context.obj
    print_jobs([client.cancel(job_id)])


@contextmanager
def readable() -> Iterator[None]:
    """Errors of the client, of a request and of files as one line and exit code 1."""
    try:
        yield
    except (DLOError, ValidationError, OSError) as error:
        if isinstance(error, BrokenPipeError):
            raise  # the reader of our output has gone: no error of ours
        print_error(described(error))
        raise typer.Exit(1) from error


def described(error: Exception) -> str:
    """In one line."""
    if isinstance(error, ValidationError):
        return describe_fields(error)
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    return str(error)


def process(
    client: Client,
    request: JobRequest[ResultT],
    images: Sequence[Path],
    out: Path | None,
    show: Show[ResultT],
    masks: bool = False,
) -> None:
    """One job a picture, or a mask where ``masks`` says so; the exit code tells at the end whether
    all went well."""
    failed = False
    for image, stem in zip(images, stems(images), strict=True):
        try:
            job = client.run_job(request, mask=image) if masks else client.run_job(request, image)
            show(image, job, save(client, job, out, stem) if out else [])
        except BrokenPipeError:
            raise
        except OSError as error:
            failed = True
            print_error(described(error))
        except DLOError as error:
            failed = True
            print_error(f"{image}: {error}")
            if isinstance(error, ConnectionFailed | Unauthorized):
                break  # the next picture would fare no better
    if failed:
        raise typer.Exit(1)
