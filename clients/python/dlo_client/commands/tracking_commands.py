"""``dlo track``: cables that keep their ids through a video or a folder of pictures."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dlo_client.client import Client
from dlo_client.commands.app import app
from dlo_client.commands.printing import print_error
from dlo_client.contracts import FrameResult, StreamedFrame, TrackOptions
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod
from dlo_client.track import Track

if TYPE_CHECKING:
    from dlo_client.video import Shot

_NEEDS_EXTRA = 'dlo track needs the extra: pip install "dlo-client[label]" (not found: {name})'

Source = Annotated[
    str, typer.Argument(metavar="VIDEO|FOLDER", help="A video file, a folder, or a pattern.")
]


@app.command()
def track(
    context: typer.Context,
    source: Source,
    out: Annotated[
        Path, typer.Option(file_okay=False, help="Folder for track.jsonl and overlay.mp4.")
    ],
    every: Annotated[int, typer.Option(min=1, help="Look at every n-th picture only.")] = 1,
    method: Annotated[
        InstanceMethod, typer.Option(help="How instances are told apart.")
    ] = DEFAULT_METHOD,
    model: Annotated[
        str | None, typer.Option(help="Foreground network; default the best one.")
    ] = None,
    effort: Annotated[
        Literal["fast", "normal", "thorough"], typer.Option(help="How hard cables are looked for.")
    ] = "normal",
    threshold: Annotated[
        float | None, typer.Option(min=0, max=1, help="Foreground threshold.")
    ] = None,
    masks: Annotated[bool, typer.Option("--masks", help="The pictures are masks.")] = False,
    video: Annotated[bool, typer.Option(help="Write overlay.mp4.")] = True,
    live: Annotated[
        bool,
        typer.Option(
            "--live",
            help="Show the pictures as fast as a camera would; what is too slow is left out.",
        ),
    ] = False,
) -> None:
    """Follow every cable through a video: track.jsonl has a line a frame, overlay.mp4 shows the
    ids."""
    if live and masks:
        raise typer.BadParameter("a stream takes pictures: leave out --live or --masks")
    options = TrackOptions(
        method=method, model=model, effort=effort, threshold=threshold, timeout_s=60
    )
    show = _live if live else partial(_one_by_one, masks=masks)
    _follow(context.obj, options, source, every, out, show, video)


Show = Callable[[Track, Iterable["Shot"], float], Iterator[tuple["Shot", FrameResult]]]
"""Track, pictures and pictures a second to pictures with their answers."""


def _follow(
    client: Client,
    options: TrackOptions,
    source: str,
    every: int,
    out: Path,
    show: Show,
    video: bool,
) -> None:
    try:
        from dlo_client.video import Film, drawn, shots
    except ModuleNotFoundError as error:
        print_error(_NEEDS_EXTRA.format(name=error.name))
        raise typer.Exit(1) from error
    pictures, rate = shots(source, every)
    out.mkdir(parents=True, exist_ok=True)
    states: Counter[str] = Counter()
    last: FrameResult | None = None
    with (
        client.track(options) as followed,
        (out / "track.jsonl").open("w", encoding="utf-8") as lines,
        Film(out / "overlay.mp4", rate) if video else nullcontext() as film,
    ):
        for shot, last in show(followed, pictures, rate):
            lines.write(last.model_dump_json() + "\n")
            states.update(cable.state for cable in last.cables)
            if film is not None:
                film.add(drawn(shot.pixels, last))
    _report(last, states, out)


def _one_by_one(
    followed: Track, pictures: Iterable[Shot], _rate: float, masks: bool
) -> Iterator[tuple[Shot, FrameResult]]:
    for shot in pictures:
        picture = {"mask": shot.data} if masks else {"image": shot.data}
        yield shot, followed.frame(**picture, time_s=shot.time_s)


def _live(
    followed: Track, pictures: Iterable[Shot], rate: float
) -> Iterator[tuple[Shot, FrameResult]]:
    """Pictures, ``rate`` a second, and their answers; some have none."""
    shown: dict[int, Shot] = {}
    with followed.stream() as stream:
        begun = time.monotonic()
        for k, shot in enumerate(pictures):
            while (
                frame := stream.answer(timeout_s=max(begun + k / rate - time.monotonic(), 0.0))
            ) is not None:
                yield _matched(shown, frame)
            shown[stream.show(shot.data, time_s=k / rate)] = shot
        for frame in stream:
            yield _matched(shown, frame)


def _matched(shown: dict[int, Shot], frame: StreamedFrame) -> tuple[Shot, FrameResult]:
    """The picture of an answer; it and earlier ones are forgotten."""
    number = frame.number or min(shown)
    shot = shown[number]
    for earlier in [k for k in shown if k <= number]:
        del shown[earlier]
    return shot, frame


def _report(last: FrameResult | None, states: Counter[str], out: Path) -> None:
    if last is None:
        print_error("there are no pictures in it")
        raise typer.Exit(1)
    counts = ", ".join(f"{state} {count}" for state, count in sorted(states.items())) or "none"
    typer.echo(
        f"{last.frame} frames, {last.track.next_id - 1} cables in all; cables by state: {counts}"
    )
    typer.echo(f"  {out / 'track.jsonl'}")
