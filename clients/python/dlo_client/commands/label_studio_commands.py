"""``dlo label-studio``: predictions for Label Studio's tasks, and its annotations kept as
corrections."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dlo_client.commands.app import Threshold, app
from dlo_client.commands.printing import print_lines
from dlo_client.contracts import InstancesRequest
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod
from dlo_client.errors import InvalidArgument

_EXTRA = 'needs its extra: pip install "dlo-client[label]"'
_LOOPBACK = ("127.0.0.1", "::1", "localhost")


@app.command("label-studio")
def label_studio(
    context: typer.Context,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="To listen on; 0 takes a free one.")
    ] = 9090,
    listen: Annotated[
        str, typer.Option(help="Address to listen on; others than loopback need a password.")
    ] = ("127.0.0.1"),
    host: Annotated[
        str, typer.Option(envvar="LABEL_STUDIO_URL", help="Address of Label Studio.")
    ] = "",
    token: Annotated[
        str, typer.Option(envvar="LABEL_STUDIO_API_KEY", help="Its access token.")
    ] = "",
    password: Annotated[
        str, typer.Option(envvar="DLO_BACKEND_PASSWORD", help="For basic authentication.")
    ] = "",
    pictures: Annotated[
        Path | None, typer.Option(file_okay=False, help="Root of its local storage.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder for finished annotations.")
    ] = None,
    method: Annotated[
        InstanceMethod, typer.Option(help="How instances are told apart.")
    ] = DEFAULT_METHOD,
    threshold: Threshold = None,
) -> None:
    """Answer Label Studio as a machine learning backend: labels for its tasks; ends at Ctrl-C."""
    try:
        from dlo_client.labelling.backend.answers import Answers
        from dlo_client.labelling.backend.pictures import TaskPictures
        from dlo_client.labelling.backend.server import serving
    except ModuleNotFoundError as error:
        raise InvalidArgument("dlo label-studio", f"{_EXTRA} (not found: {error.name})") from None
    if listen not in _LOOPBACK and not password:
        raise InvalidArgument(
            "password", f"is needed to listen on {listen}: anybody there could use the service"
        )
    request = InstancesRequest(method=method, threshold=threshold, files=[])
    answers = Answers(context.obj, TaskPictures(host, token, pictures), request, out)
    with serving(answers, listen, port, password) as address:
        print_lines([f"ready at {address}: add it in Label Studio under Settings, Model"])
        _forever()


def _forever() -> None:
    from threading import Event

    Event().wait()
