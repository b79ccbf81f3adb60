"""The commands for labels: ``dlo label``, ``label-export``, ``-import``, ``-dataset`` and
``-tracked``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from pydantic import TypeAdapter

from dlo_client.client import Client
from dlo_client.commands.app import app, readable
from dlo_client.commands.labelling_formats import Format, Tool
from dlo_client.commands.labelling_progress import shown_progress
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
from dlo_client.labelling.sources import VIDEOS, SourcePicture, picture_names
from dlo_client.labelling.tracked import file_tracked

if TYPE_CHECKING:
    from dlo_client.labelling.formats import Labels

_NEEDS_EXTRA = 'formats need the extra: pip install "dlo-client[label]" (not found: {name})'

Folder = Annotated[Path, typer.Argument(metavar="OUT", help="The folder that `dlo label` filled.")]


class Frames(StrEnum):
    """Which picture a frame of a video is: ``frame_000012``, or the 13th of all by name."""

    BY_NAME = "by-name"
    IN_ORDER = "in-order"


Formats = Annotated[
    list[Format], typer.Option("--format", help="Write labels for this tool too; may be repeated.")
]


@app.command()
def label(
    context: typer.Context,
    source: Annotated[
        str,
        typer.Argument(
            help="A folder, a glob pattern, a ZIP archive, a list of paths, or a video."
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="Folder for the labels; a run that was cut off goes on there.")
    ],
    formats: Formats = [],  # noqa: B006
    at_once: Annotated[int, typer.Option(min=1, max=256, help="Pictures in flight.")] = 8,
    method: Annotated[
        InstanceMethod, typer.Option(help="How instances are told apart.")
    ] = DEFAULT_METHOD,
    threshold: Annotated[
        float | None, typer.Option(min=0, max=1, help="Foreground threshold.")
    ] = None,
    retry_failed: Annotated[bool, typer.Option(help="Take up again what failed before.")] = False,
    clip: Annotated[
        bool,
        typer.Option(
            "--clip",
            help="The pictures follow each other: from those that are corrected, as a video.",
        ),
    ] = False,
    every: Annotated[
        int, typer.Option(min=1, help="Of a clip, label every n-th picture only.")
    ] = 1,
) -> None:
    """Label every picture of a source, at batch priority: robots go first. A video, or a folder
    with --clip, is labelled from its corrected pictures, under the same ids."""
    request = InstancesRequest(
        method=method, threshold=threshold, files=[], timeout_s=600, priority="batch"
    )
    if clip or Path(source).suffix.lower() in VIDEOS:
        _label_clip(context.obj, source, out, request, every, formats)
        return
    options = LabelOptions(request, at_once=at_once, retry_failed=retry_failed)
    _label_pictures(context.meta[CONNECTION], source, out, options, formats)


def _label_pictures(
    connection: Connection, source: str, out: Path, options: LabelOptions, formats: Formats
) -> None:
    with readable_labels():
        pictures = find_pictures(source, skip=out)
        with shown_progress() as progress:
            try:
                report = label_pictures(
                    pictures,
                    out,
                    options,
                    url=connection.url,
                    api_key=connection.key,
                    progress=progress,
                    transport=connection.transport,
                )
            except BatchStopped as stopped:
                report = stopped.report
        _print(report.lines())
        _write(out, formats)
    if report.failed or report.stopped:
        raise typer.Exit(1)


def _label_clip(
    client: Client, source: str, out: Path, request: InstancesRequest, every: int, formats: Formats
) -> None:
    with readable_labels():
        from dlo_client.labelling.clips import label_clip

        with shown_progress() as progress:
            report = label_clip(source, out, client, request, every=every, progress=progress)
        _print(report.lines())
        _write(out, formats)


@app.command(name="label-export")
def label_export(
    folder: Folder,
    formats: Formats,
    pictures: Annotated[
        str | None,
        typer.Option(
            help="Where the pictures are by now; `yolo` copies them. Default: where they were."
        ),
    ] = None,
) -> None:
    """Write the labels of a folder for other tools; corrections go before the service's own."""
    with readable_labels():
        _write(folder, formats, pictures)


@app.command(name="label-import")
def label_import(
    folder: Folder,
    file: Annotated[Path, typer.Argument(help="What the tool exported.")],
    tool: Annotated[Tool, typer.Option(help="Which tool.")],
    classes: Annotated[
        list[str], typer.Option("--label", help="What a cable is called there; may be repeated.")
    ] = [  # noqa: B006
        "dlo"
    ],
    line_width: Annotated[
        float, typer.Option(min=1, max=1000, help="Pixels, of lines that name no width.")
    ] = 6.0,
    frames: Annotated[
        Frames, typer.Option(help="How frames of a video are found.")
    ] = Frames.BY_NAME,
) -> None:
    """Take corrections back from a labelling tool and say what they changed, and what was left
    out."""
    with readable_labels():
        from dlo_client.labelling.corrections import take_corrections
        from dlo_client.labelling.formats import READERS, Wanted

        with LabelStore(folder) as store:
            in_order = frames is Frames.IN_ORDER
            sizes = (
                {label.name: (label.width, label.height) for label in store.labels()}
                if tool is Tool.CVAT
                else {}
            )
            wanted = Wanted(frozenset(classes), line_width, sizes, in_order)
            report = take_corrections(store, READERS[tool.value](file, wanted))
            report.save(folder)
        _print(report.lines())
    if report.problems:
        raise typer.Exit(1)


@app.command(name="label-dataset")
def label_dataset(
    folder: Folder,
    source: Annotated[str, typer.Argument(help="Where the pictures are, as for `dlo label`.")],
    into: Annotated[Path, typer.Argument(help="Folder for the training set.")],
    everything: Annotated[
        bool, typer.Option("--all", help="Also labels that nobody corrected.")
    ] = False,
) -> None:
    """Pictures with corrected labels as a training set that the service's training can mix in."""
    with readable_labels():
        from dlo_client.labelling.training_set import export_training_set

        with LabelStore(folder) as store:
            problems = export_training_set(
                store, find_pictures(source), into, corrected_only=not everything
            )
        _print([f"{name}: {why}" for name, why in problems.items()])
    if problems:
        raise typer.Exit(1)


@app.command(name="label-tracked")
def label_tracked(
    context: typer.Context,
    cameras: Annotated[
        Path, typer.Argument(help="JSON: a list of {intrinsics, T_world_camera}, one a picture.")
    ],
    strokes: Annotated[
        Path, typer.Argument(help="JSON: a list of {points_m, thickness_m, name?}, one a cable.")
    ],
    images: Annotated[
        list[Path], typer.Argument(metavar="IMAGE...", help="The pictures, in the cameras' order.")
    ],
    out: Annotated[Path, typer.Option(help="Folder for the labels, as `dlo label` fills it.")],
    tracker: Annotated[
        Path | None, typer.Option(help="JSON: T_world_tracker (4×4), if strokes are in its frame.")
    ] = None,
    formats: Formats = [],  # noqa: B006
    timeout: Annotated[float, typer.Option(min=1, max=3600, help="Seconds.")] = 600.0,
) -> None:
    """Label pictures from known poses with one stroke of a tracked pen a cable."""
    client: Client = context.obj
    with readable_labels():
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
            result = client.run(request, images)
            labels = file_tracked(store, result, picture_names(images))
        for label, view in zip(labels, result.views, strict=True):
            _print(
                [f"{label.name}: {len(label.instances)} cables, moved by {view.moved_px:.1f} px"]
            )
        _print([f"warning: {text}" for text in result.warnings])
        _write(out, formats)


def _text(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ValueError(f"{file}: {error.strerror}") from error


def _write(folder: Path, formats: Iterable[Format], source: str | None = None) -> None:
    """All formats; what could not be written of one is said at the end, with exit code 1."""
    wanted = list(formats)
    if not wanted:
        return
    from dlo_client.labelling.formats import WRITERS

    problems: dict[str, str] = {}
    with LabelStore(folder) as store:
        for name in wanted:
            labels = _best_labels(store)
            if name is Format.YOLO:
                file = WRITERS[name.value](
                    labels, folder, _pictures(store, source, problems), problems
                )
            else:
                file = WRITERS[name.value](labels, folder)
            _print([f"wrote {file}"])
    _print([f"  {name}: {why}" for name, why in problems.items()])
    if problems:
        raise typer.Exit(1)


def _pictures(
    store: LabelStore, source: str | None, problems: dict[str, str]
) -> dict[str, SourcePicture] | None:
    """By name; None where they cannot be found, which is a problem."""
    where = source or store.source()
    try:
        if where is None:
            raise SourceError("it is not known where they are")
        return {picture.name: picture for picture in find_pictures(where, skip=store.folder)}
    except SourceError as error:
        problems["pictures"] = (
            f"{error}; the labels are written without them, --pictures names their place"
        )
        return None


def _best_labels(store: LabelStore) -> Labels:
    """Every label, the corrected one where there is one."""
    from dlo_client.labelling.store import corrected_file, read_label

    def labels() -> Iterator[PictureLabel]:
        for name, entry in store.entries().items():
            if entry.state != "failed":
                corrected = corrected_file(store.folder, name)
                yield read_label(corrected) if corrected.exists() else store.label(name)

    return labels


def _print(lines: Iterable[str]) -> None:
    for line in lines:
        typer.echo(line.encode("utf-8", "replace").decode())


@contextmanager
def readable_labels() -> Iterator[None]:
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
