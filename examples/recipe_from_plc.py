"""A recipe over TCP, as a PLC runs it: store recipe 7, start a bridge, trigger, read the result.

A real PLC sends the same lines to ``dlo bridge bridge.toml``; see examples/robots.
"""

from __future__ import annotations

import argparse
import asyncio
from pathlib import Path

from dlo_client import AsyncClient, CameraBody, RecipeBody
from dlo_client.bridge.server import bridge
from dlo_client.bridge.settings import BridgeSettings

SAMPLE = Path(__file__).parent.parent / "tests" / "samples" / "plain.jpg"
CAMERA = CameraBody.model_validate(
    {
        "intrinsics": {"width": 640, "height": 360, "fx": 600, "fy": 600, "cx": 319.5, "cy": 179.5},
        "T_world_camera": [[1, 0, 0, 0.4], [0, -1, 0, 0.0], [0, 0, -1, 0.6], [0, 0, 0, 1]],
    }
)
RECIPE = RecipeBody.model_validate(
    {
        "name": "cables on the table",
        "request": {"kind": "instances", "files": []},
        "camera": "over-the-table",
        "output": {"unit": "mm", "rotation": "kuka_abc"},
    }
)


def main(arguments: list[str] | None = None) -> list[str]:
    """The replies."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    options = parser.parse_args(arguments)
    return asyncio.run(talk(options.url))


async def talk(url: str | None) -> list[str]:
    """Lines of a controller, and their replies."""
    settings = BridgeSettings.model_validate({"ascii": {"port": 0}, "picture": {"file": SAMPLE}})
    replies = []
    async with AsyncClient(url) as client:
        await client.store_camera("over-the-table", CAMERA)
        await client.store_recipe(7, RECIPE)
        async with bridge(settings, client) as ports:
            reader, writer = await asyncio.open_connection("127.0.0.1", ports["ascii"])
            for line in ("H,1", "T,1,7", "R,1,30000", "G,1,2", "X,1"):
                writer.write(line.encode() + b"\r\n")
                replies.append((await reader.readline()).decode().strip())
                print(f"{line:12} {replies[-1]}")
            writer.close()
    return replies


if __name__ == "__main__":
    main()
