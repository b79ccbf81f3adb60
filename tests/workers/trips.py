"""How often the queue server is asked."""

from __future__ import annotations

from collections.abc import Callable

from workers.connection import connect
from workers.settings import Settings


def commands_during(settings: Settings, act: Callable[[], object]) -> dict[str, int]:
    """Commands that reach the queue server while ``act`` runs, those within scripts too, and how
    many of each."""
    with connect(settings) as client:
        client.config_resetstat()
        act()
        rows = client.info("commandstats")
    counts = {name.removeprefix("cmdstat_"): row["calls"] for name, row in rows.items()}
    counts.pop("config|resetstat")
    return counts
