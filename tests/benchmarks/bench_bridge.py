"""What ``dlo bridge`` adds to a recipe over REST: ``python -m tests.benchmarks.bench_bridge
[--rounds N]``.

Both run the same recipe (`instances` of a small mask) on one service, in turn, so that what else
the machine does concerns both. Over TCP a run is a trigger and its result: the picture is read, the
job is run, the poses are there. Writes ``build/bench/bridge.json``.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from dlo_client import AsyncClient, RecipeBody
from dlo_client.bridge.server import bridge
from dlo_client.bridge.settings import BridgeSettings

from tests.faults.plant import plant

NUMBER = 65_000
WARM_UP = 10
_SIZE_PX = (160, 90)


class Line:
    """A controller on the text protocol."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    async def run(self, sequence: int) -> None:
        """Trigger the recipe and wait for its result."""
        for line in (f"T,{sequence},{NUMBER}", f"R,{sequence},60000"):
            self._writer.write(f"{line}\n".encode())
            reply = (await self._reader.readline()).decode().strip()
        status = int(reply.split(",")[2])
        assert status < 20, reply


async def measure(url: str, picture: Path, rounds: int) -> np.ndarray:
    """Milliseconds (rounds, 2) over REST and over TCP; which of the two comes first alternates."""
    settings = BridgeSettings.model_validate({"ascii": {"port": 0}, "picture": {"file": picture}})
    took_ms = np.empty((WARM_UP + rounds, 2))
    async with AsyncClient(url) as client, bridge(settings, client) as ports:
        await client.store_recipe(
            NUMBER, RecipeBody(name="bench", request={"kind": "instances", "files": []})
        )
        line = Line(*await asyncio.open_connection("127.0.0.1", ports["ascii"]))
        for number in range(len(took_ms)):
            for which in (0, 1) if number % 2 else (1, 0):
                began = time.perf_counter()
                await (line.run(number) if which else client.run_recipe(NUMBER, picture))
                took_ms[number, which] = 1000 * (time.perf_counter() - began)
    return took_ms[WARM_UP:]


def summary(took_ms: np.ndarray) -> dict[str, Any]:
    """Median of each way, of their difference within a round, and its standard error by 1000
    redraws."""
    added = took_ms[:, 1] - took_ms[:, 0]
    redraws = np.random.default_rng(0).choice(added, (1000, len(added)))
    rest, tcp = np.median(took_ms, axis=0)
    error = np.median(redraws, axis=1).std()
    values = {"rest_ms": rest, "tcp_ms": tcp, "added_ms": np.median(added), "error_ms": error}
    return {
        "rounds": len(took_ms),
        **{name: round(float(value), 2) for name, value in values.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=200)
    parser.add_argument("--out", type=Path, default=Path("build/bench/bridge.json"))
    asked = parser.parse_args()
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    with plant() as there:
        picture = there.folder / "picture.png"
        mask = np.zeros(_SIZE_PX[::-1], np.uint8)
        cv2.line(mask, (10, 20), (150, 70), 255, 5)
        cv2.imwrite(str(picture), mask)
        found = summary(asyncio.run(measure(there.url, picture, asked.rounds)))
    print(json.dumps(found))
    asked.out.write_text(json.dumps(found))


if __name__ == "__main__":
    main()
