"""``dlo review``: the pictures that the service was least sure of, into a folder and to the
corrector."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from dlo_client.client import Client
from dlo_client.commands.app import app
from dlo_client.commands.labelling_commands import readable_labels
from dlo_client.commands.printing import print_lines
from dlo_client.connection import CONNECTION, Connection, base_url
from dlo_client.labelling.store import write_whole

_CORRECTOR = "viewer/label.html"
_SIGNATURES = {
    b"\x89PNG": ".png",
    b"\xff\xd8": ".jpg",
    b"RIFF": ".webp",
    b"BM": ".bmp",
    b"GIF8": ".gif",
}


@app.command()
def review(
    context: typer.Context,
    out: Annotated[Path, typer.Argument(file_okay=False, help="Folder for the pictures.")],
    most: Annotated[int, typer.Option(min=1, help="At most so many.")] = 20,
    keep: Annotated[bool, typer.Option("--keep", help="Leave them in the service too.")] = False,
    browser: Annotated[bool, typer.Option(help="Open the page that corrects.")] = True,
) -> None:
    """Fetch the pictures that the service was least sure of and open the page that corrects them.

    The service keeps those of requests that allow it (`keep_if_unsure`). Drop them on the page,
    correct, save the labels; then `dlo label OUT --out labels`, `dlo label-import labels FILE
    --tool json` and `dlo adapt labels`.
    """
    client: Client = context.obj
    connection: Connection = context.meta[CONNECTION]
    with readable_labels():
        found = client.unsure()[:most]
        for number, picture in enumerate(found):
            data = client.unsure_picture(picture)
            file = out / f"{number:03d}-{picture.id[:12]}{_suffix(data)}"
            write_whole(file, data)
            print_lines([f"{file}: certainty {picture.certainty:.2f}, {picture.doubt}"])
            if not keep:
                client.drop_unsure(picture)
    if not found:
        print_lines(
            ["nothing to review: no request allowed its picture to be kept, or all were sure"]
        )
        return
    address = base_url(connection.url).join(f"/{_CORRECTOR}")
    print_lines([f"correct them at {address}"])
    if browser:
        webbrowser.open(str(address))


def _suffix(data: bytes) -> str:
    return next((suffix for start, suffix in _SIGNATURES.items() if data.startswith(start)), ".tif")
