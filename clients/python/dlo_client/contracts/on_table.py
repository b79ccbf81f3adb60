"""Places on a table, in meters."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

FARTHEST_M = 1e3
Meters = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Point2 = tuple[Meters, Meters]

LEAST_LENGTH_M = 1e-3
LONGEST_M = 20.0
"""Of a DLO that is handled on a table."""
