"""Requests of ``plan_shape`` that tests change a little."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts import DloObject, PlanShapeRequest, PlanShapeResult
from dlo_client.demo.simulated_table import target_shape

from workers import stages
from workers.stages.outcome import Tools

LENGTH = 0.45
OBJECT = DloObject(mass_kg=0.05)
U = target_shape("U", LENGTH)


def line(points: int = 16, length: float = LENGTH) -> list[tuple[float, float]]:
    return [(float(x), 0.0) for x in np.linspace(-length / 2, length / 2, points)]


def request(**fields) -> PlanShapeRequest:
    return PlanShapeRequest(**({"state_m": line(), "target_m": U, "object": OBJECT} | fields))


def run(tools: Tools, **fields) -> PlanShapeResult:
    return stages.run(request(**fields), tools).result
