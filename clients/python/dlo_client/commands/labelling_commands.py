"""The commands for labels: ``dlo label``, ``label-export``, ``-import``, ``-dataset`` and ``-tracked``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from pydantic import TypeAdapter
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from dlo_client.client import Client
from dlo_client.commands.app import app, readable
from dlo_client.commands.printing import print_error
from dlo_client.connection import CONNECTION, Connection
from dlo_client.contracts import CameraView, InstancesRequest, LabelTrackedRequest, Pose, Stroke
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod
from dlo_client.labelling import (
    BatchStopped,
    LabelOptions,
    LabelStore,
    PictureLabel,
    SourceError,
    StoreError,
    find_pictures,
    label_pictures,
)
from dlo_client.labelling.sources import picture_names
from dlo_client.labelling.tracked import file_tracked
from dlo_client.outcomes import result_of

if TYPE_CHECKING:
    from dlo_client.labelling.formats import Labels

_NEEDS_EXTRA = 'formats need the extra: pip install "dlo-client[label]" (not found: {name})'

Folder = Annotated[Path, typer.Argument(metavar="OUT", help="The folder that `dlo label` filled.")]


class Format(StrEnum):
    """What labels can be written as."""

    COCO = "coco"
    COCO_POLYGONS = "coco-polygons"
    YOLO = "yolo"
    CVAT = "cvat"
    LABEL_STUDIO = "label-studio"
    PNG = "png"
    JSON = "json"


class Tool(StrEnum):
    """Where corrections can come from."""

    COCO = "coco"
    CVAT = "cvat"
    LABEL_STUDIO = "label-studio"
    JSON = "json"


Formats = Annotated[list[Format], typer.Option("--format", help="Write labels for this tool too; may be repeated.")]


@app.command()
def label(
    context: typer.Context,
    source: Annotated[str, typer.Argument(help="A folder, a glob pattern, a ZIP archive, or a list of paths.")],
    out: Annotated[Path, typer.Option(help="Folder for the labels; a run that was cut off goes on there.")],
    formats: Formats = [],  # noqa: B006
    at_once: Annotated[int, typer.Option(min=1, max=256, help="Pictures in flight.")] = 8,
    method: Annotated[InstanceMethod, typer.Option(help="How instances are told apart.")] = DEFAULT_METHOD,
    threshold: Annotated[float | None, typer.Option(min=0, max=1, help="Foreground threshold.")] = None,
    retry_failed: Annotated[bool, typer.Option(help="Take up again what failed before.")] = False,
) -> None:
    """Label every picture of a source, at batch priority: robots go first."""
    connection: Connection = context.meta[CONNECTION]
    request = InstancesRequest(method=method, threshold=threshold, files=[], timeout_s=600)
    options = LabelOptions(request, at_once=at_once, retry_failed=retry_failed)
    with _readable():
        pictures = find_pictures(source, skip=out)
        with _shown_progress() as progress:
            try:
                report = label_pictures(
                    pictures, out, options, url=connection.url, api_key=connection.key, progress=progress,
                    transport=connection.transport,
                )  # fmt: skip
            except BatchStopped as stopped:
                report = stopped.report
        _print(report.lines())
        _write(out, formats)
    if report.failed or report.stopped:
        raise typer.Exit(1)


@app.command(name="label-export")
def label_export(folder: Folder, formats: Formats) -> None:
    """Write the labels of a folder for other tools; corrections go before the service's own."""
    with _readable():
        _write(folder, formats)


@app.command(name="label-import")
def label_import(
    folder: Folder,
    file: Annotated[Path, typer.Argument(help="What the tool exported.")],
    tool: Annotated[Tool, typer.Option(help="Which tool.")],
) -> None:
    """Take corrections back from a labelling tool and say what they changed."""
    with _readable():
        from dlo_client.labelling.corrections import take_corrections
        from dlo_client.labelling.formats import READERS

        with LabelStore(folder) as store:
            report = take_corrections(store, READERS[tool.value](file))
        _print(report.lines())
    if report.problems:
        raise typer.Exit(1)


@app.command(name="label-dataset")
def label_dataset(
    folder: Folder,
    source: Annotated[str, typer.Argument(help="Where the pictures are, as for `dlo label`.")],
    into: Annotated[Path, typer.Argument(help="Folder for the training set.")],
    everything: Annotated[bool, typer.Option("--all", help="Also labels that nobody corrected.")] = False,
) -> None:
    """Pictures with corrected labels as a training set that the service's training can mix in."""
    with _readable():
        from dlo_client.labelling.training_set import export_training_set

        with LabelStore(folder) as store:
            problems = export_training_set(store, find_pictures(source), into, corrected_only=not everything)
        _print([f"{name}: {why}" for name, why in problems.items()])
    if problems:
        raise typer.Exit(1)


@app.command(name="label-tracked")
def label_tracked(
    context: typer.Context,
    cameras: Annotated[Path, typer.Argument(help="JSON: a list of {intrinsics, T_world_camera}, one a picture.")],
    strokes: Annotated[Path, typer.Argument(help="JSON: a list of {points_m, thickness_m, name?}, one a cable.")],
    images: Annotated[list[Path], typer.Argument(metavar="IMAGE...", help="The pictures, in the cameras' order.")],
    out: Annotated[Path, typer.Option(help="Folder for the labels, as `dlo label` fills it.")],
    tracker: Annotated[
        Path | None, typer.Option(help="JSON: T_world_tracker (4×4), if strokes are in its frame.")
    ] = None,
    formats: Formats = [],  # noqa: B006
    timeout: Annotated[float, typer.Option(min=1, max=3600, help="Seconds.")] = 600.0,
) -> None:
    """Label pictures from known poses with one stroke of a tracked pen a cable."""
    client: Client = context.obj
    with _readable():
        views = TypeAdapter(list[CameraView]).validate_json(_text(cameras))
        marked = TypeAdapter(list[Stroke]).validate_json(_text(strokes))
        if len(views) != len(images):
            raise ValueError(f"{cameras}: has {len(views)} cameras for {len(images)} pictures")
        frame = TypeAdapter(Pose).validate_json(_text(tracker)) if tracker else None
        request = LabelTrackedRequest(
            views=views, strokes=marked, T_world_tracker=frame, priority="batch", timeout_s=timeout
        )
        # The folder is opened first: nobody should wait for labels that have no place.
        with LabelStore(out, write=True) as store:
            store.remember({"kind": request.kind})
            result = result_of(client.run(request, images))
            labels = file_tracked(store, result, picture_names(images))
        for label, view in zip(labels, result.views, strict=True):
            _print([f"{label.name}: {len(label.instances)} cables, moved by {view.moved_px:.1f} px"])
        _print([f"warning: {text}" for text in result.warnings])
        _write(out, formats)


def _text(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ValueError(f"{file}: {error.strerror}") from error


def _write(folder: Path, formats: Iterable[Format]) -> None:
    wanted = list(formats)
    if not wanted:
        return
    from dlo_client.labelling.formats import WRITERS

    with LabelStore(folder) as store:
        for name in wanted:
            _print([f"wrote {WRITERS[name.value](_best_labels(store), folder)}"])


def _best_labels(store: LabelStore) -> Labels:
    """Every label, the corrected one where there is one."""
    from dlo_client.labelling.corrections import corrected_file
    from dlo_client.labelling.store import read_label

    def labels() -> Iterator[PictureLabel]:
        for name, entry in store.entries().items():
            if entry.state != "failed":
                corrected = corrected_file(store.folder, name)
                yield read_label(corrected) if corrected.exists() else store.label(name)

    return labels


@contextmanager
def _shown_progress() -> Iterator[_Shown]:
    console = Console(stderr=True)
    columns = [
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"), TimeRemainingColumn(elapsed_when_finished=True),
    ]  # fmt: skip
    with Progress(*columns, console=console, disable=not console.is_terminal) as bar:
        yield _Shown(bar)


class _Shown:
    """A bar with rate and time left; what was done before the run does not count for the rate."""

    def __init__(self, bar: Progress) -> None:
        self._bar = bar
        self._task = bar.add_task("labelling", total=None, rate="")

    def __call__(self, done: int, failed: int, total: int) -> None:
        speed = self._bar.tasks[0].speed
        rate = f"{speed:.1f}/s" if speed else ""
        text = f"labelling, {failed} failed" if failed else "labelling"
        self._bar.update(self._task, completed=done, total=total, description=text, rate=rate)


def _print(lines: Iterable[str]) -> None:
    for line in lines:
        typer.echo(line.encode("utf-8", "replace").decode())


@contextmanager
def _readable() -> Iterator[None]:
    """Errors of this area too as one line and exit code 1."""
    try:
        with readable():
            yield
    except ModuleNotFoundError as error:
        print_error(_NEEDS_EXTRA.format(name=error.name))
        raise typer.Exit(1) from error
    except OSError as error:
        print_error(f"{error.filename}: {error.strerror}" if error.filename else str(error))
        raise typer.Exit(1) from error
    except (SourceError, StoreError, ValueError) as error:
        print_error(str(error))
        raise typer.Exit(1) from error
