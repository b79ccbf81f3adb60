"""``dlo track``: cables that keep their ids through a video or a folder of pictures."""

from __future__ import annotations

from collections import Counter
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Literal

import typer

from dlo_client.client import Client
from dlo_client.commands.app import app
from dlo_client.commands.printing import print_error
from dlo_client.contracts import FrameResult, TrackOptions
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod

_NEEDS_EXTRA = 'dlo track needs the extra: pip install "dlo-client[label]" (not found: {name})'

Source = Annotated[str, typer.Argument(metavar="VIDEO|FOLDER", help="A video file, a folder, or a pattern.")]


@app.command()
def track(
    context: typer.Context,
    source: Source,
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder for track.jsonl and overlay.mp4.")],
    every: Annotated[int, typer.Option(min=1, help="Look at every n-th picture only.")] = 1,
    method: Annotated[InstanceMethod, typer.Option(help="How instances are told apart.")] = DEFAULT_METHOD,
    model: Annotated[str | None, typer.Option(help="Foreground network; default the best one.")] = None,
    effort: Annotated[Literal["fast", "normal", "thorough"], typer.Option(help="How hard cables are looked for.")] = (
        "normal"
    ),
    threshold: Annotated[float | None, typer.Option(min=0, max=1, help="Foreground threshold.")] = None,
    masks: Annotated[bool, typer.Option("--masks", help="The pictures are masks.")] = False,
    video: Annotated[bool, typer.Option(help="Write overlay.mp4.")] = True,
) -> None:
    """Follow every cable through a video: track.jsonl has a line a frame, overlay.mp4 shows the ids."""
    try:
        from dlo_client.video import Film, drawn, shots
    except ModuleNotFoundError as error:
        print_error(_NEEDS_EXTRA.format(name=error.name))
        raise typer.Exit(1) from error
    client: Client = context.obj
    options = TrackOptions(method=method, model=model, effort=effort, threshold=threshold, timeout_s=60)
    pictures, rate = shots(source, every)
    out.mkdir(parents=True, exist_ok=True)
    states: Counter[str] = Counter()
    last: FrameResult | None = None
    with (
        client.track(options) as followed,
        (out / "track.jsonl").open("w", encoding="utf-8") as lines,
        Film(out / "overlay.mp4", rate) if video else nullcontext() as film,
    ):
        for shot in pictures:
            picture = {"mask": shot.data} if masks else {"image": shot.data}
            last = followed.frame(**picture, time_s=shot.time_s)
            lines.write(last.model_dump_json() + "\n")
            states.update(cable.state for cable in last.cables)
            if film is not None:
                film.add(drawn(shot.pixels, last))
    _report(last, states, out)


def _report(last: FrameResult | None, states: Counter[str], out: Path) -> None:
    if last is None:
        print_error("there are no pictures in it")
        raise typer.Exit(1)
    counts = ", ".join(f"{state} {count}" for state, count in sorted(states.items())) or "none"
    typer.echo(f"{last.frame} frames, {last.track.next_id - 1} cables in all; cables by state: {counts}")
    typer.echo(f"  {out / 'track.jsonl'}")
