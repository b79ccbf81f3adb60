"""What the bridge adds to a recipe over REST: ``python -m tests.benchmarks.bench_bridge`` beside a running service.

Both run the same recipe (`segment`) with one picture, one after the other; the median counts.
"""

from __future__ import annotations

import argparse
import asyncio
import statistics
import time
from pathlib import Path

from dlo_client import AsyncClient, RecipeBody
from dlo_client.bridge.server import bridge
from dlo_client.bridge.settings import BridgeSettings

PICTURE = Path(__file__).parents[1] / "samples" / "plain.jpg"
NUMBER = 65_000


async def measure(url: str | None, rounds: int) -> tuple[float, float]:
    """Median milliseconds over REST and over TCP."""
    settings = BridgeSettings.model_validate({"ascii": {"port": 0}, "picture": {"file": PICTURE}})
    rest, tcp = [], []
    async with AsyncClient(url) as client, bridge(settings, client) as ports:
        await client.store_recipe(NUMBER, RecipeBody(name="bench", request={"kind": "segment"}))
        reader, writer = await asyncio.open_connection("127.0.0.1", ports["ascii"])
        for number in range(rounds):
            began = time.perf_counter()
            await client.run_recipe(NUMBER, PICTURE)
            rest.append(time.perf_counter() - began)
            began = time.perf_counter()
            for line in (f"T,{number},{NUMBER}\n", f"R,{number},60000\n"):
                writer.write(line.encode())
                await reader.readline()
            tcp.append(time.perf_counter() - began)
        writer.close()
    return 1000 * statistics.median(rest), 1000 * statistics.median(tcp)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url")
    parser.add_argument("--rounds", type=int, default=60)
    options = parser.parse_args()
    rest, tcp = asyncio.run(measure(options.url, options.rounds))
    print(f"REST {rest:.1f} ms, TCP {tcp:.1f} ms, overhead {tcp - rest:.1f} ms")


if __name__ == "__main__":
    main()
