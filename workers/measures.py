"""What is counted about jobs, inside the queue server: so every replica of the service exports the
same.

A hash of ``name|label|…`` to a number; of a histogram ``name|label|…|bound`` to how many were at
most ``bound`` and above the bound before it, and ``name|label|…|sum``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from workers.keys import Keys
from workers.lua import filled

BOUNDS_S = (
    0.005,
    0.01,
    0.025,
    0.05,
    0.1,
    0.25,
    0.5,
    1.0,
    2.5,
    5.0,
    10.0,
    30.0,
    60.0,
    300.0,
    1800.0,
)

_LUA = """
local bounds = {@bounds@}
local function add(field, number) redis.call('HINCRBY', '@measures@', field, number) end

local function observe(field, seconds)
  local found = '+Inf'
  for _, bound in ipairs(bounds) do
    if seconds <= tonumber(bound) then found = bound; break end
  end
  add(field .. '|' .. found, 1)
  redis.call('HINCRBYFLOAT', '@measures@', field .. '|sum', string.format('%.6f', math.max(seconds, 0)))
end
"""


def script(keys: Keys) -> str:
    """Lua: ``add(field, number)`` and ``observe(field, seconds)``."""
    return filled(
        _LUA, measures=keys.measures, bounds=", ".join(f"'{bound:g}'" for bound in BOUNDS_S)
    )


@dataclass
class Observed:
    """A histogram: how many were at most each bound in seconds (not cumulative), and their sum."""

    counts: dict[str, int] = field(default_factory=dict)
    sum_s: float = 0.0

    def cumulative(self) -> list[tuple[str, float]]:
        """As Prometheus has it: upper bound, number of observations up to it."""
        total, buckets = 0, []
        for bound in (*(f"{bound:g}" for bound in BOUNDS_S), "+Inf"):
            total += self.counts.get(bound, 0)
            buckets.append((bound, float(total)))
        return buckets


@dataclass
class Measures:
    """Numbers by name and labels."""

    counters: dict[tuple[str, ...], float] = field(default_factory=dict)
    histograms: dict[tuple[str, ...], Observed] = field(default_factory=dict)

    @classmethod
    def read(cls, stored: Mapping[str, str]) -> Measures:
        """From the hash."""
        found = cls()
        for name, number in stored.items():
            *labels, last = name.split("|")
            if labels[0] not in HISTOGRAMS:
                found.counters[(*labels, last)] = float(number)
                continue
            observed = found.histograms.setdefault(tuple(labels), Observed())
            if last == "sum":
                observed.sum_s = float(number)
            else:
                observed.counts[last] = int(number)
        return found


HISTOGRAMS = {
    "wait": ("Seconds that jobs waited before they were taken up", ("priority",)),
    "run": ("Seconds that attempts at jobs took, by how the job ended", ("kind", "state")),
    "stage": ("Seconds that the steps of succeeded jobs took", ("kind", "stage")),
}
"""Name to its text and its labels."""

COUNTERS = {
    "failed": ("Jobs that failed, by the code of their problem", ("kind", "code")),
    "retried": ("Jobs that were taken up again because their worker had died", ("kind",)),
    "preempted": ("Times that a batch job stood still for an interactive one", ("kind",)),
    "owner": ("Jobs that have ended, by the API key that sent them", ("owner", "state")),
    "owner_seconds": ("Seconds that workers spent on the jobs of an API key", ("owner",)),
    "webhook": ("Webhooks by what came of them", ("outcome",)),
}
"""As HISTOGRAMS."""
