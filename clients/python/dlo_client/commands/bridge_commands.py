"""``dlo bridge``: recipes for controllers, over TCP."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Annotated

import typer

from dlo_client.async_client import AsyncClient
from dlo_client.bridge.server import bridge
from dlo_client.bridge.settings import BridgeSettings, read
from dlo_client.commands.app import app
from dlo_client.commands.printing import print_lines
from dlo_client.connection import CONNECTION, Connection


@app.command("bridge")
def run_bridge(
    context: typer.Context,
    settings: Annotated[
        Path, typer.Argument(metavar="TOML", dir_okay=False, help="Ports, camera, service.")
    ],
) -> None:
    """Let robot controllers and PLCs run recipes over TCP, as text lines or fixed bytes; ends at
    Ctrl-C."""
    connection: Connection = context.meta[CONNECTION]
    asyncio.run(_serve(read(settings), connection))


async def _serve(settings: BridgeSettings, connection: Connection) -> None:
    url = connection.url or settings.service.url
    async with AsyncClient(url, connection.key) as client, bridge(settings, client) as ports:
        print_lines(
            [f"ready: {', '.join(f'{name} on port {port}' for name, port in ports.items())}"]
        )
        await asyncio.Event().wait()
