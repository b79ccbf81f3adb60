"""``next_view``: a known curve and a camera to the poses of the next pictures."""

from __future__ import annotations

import numpy as np
from dlo_client.contracts import NextViewRequest, NextViewResult
from dlo_client.contracts.cameras import FARTHEST_M

from models.reconstruction.view_planning import NoView, PlanParams, plan_views
from workers.stages import curves3d
from workers.stages.outcome import InvalidInput, Outcome


def run(request: NextViewRequest) -> Outcome:
    curve = curves3d.decode(request.curve, "curve")
    cameras = [curves3d.camera(c, f"cameras.{k}") for k, c in enumerate(request.cameras)]
    params = PlanParams(
        views=request.pictures,
        optimise=request.optimise,
        baseline_m=request.baseline_m,
        baseline_at_most_m=request.baseline_at_most_m,
        nearest_m=request.nearest_m,
        delta_z_m=request.delta_z_m,
        margin_px=request.margin_px,
        overlap=request.overlap,
    )
    try:
        plan = plan_views(curve, cameras, params, request.advance)
    except NoView as error:
        raise InvalidInput("cameras", str(error), "invalid_views") from error
    if max(np.abs(pose[:3, 3]).max() for pose in plan.poses) > FARTHEST_M:
        text = f"lead to a pose more than {FARTHEST_M:g} m away: are they in meters?"
        raise InvalidInput("cameras", text, "invalid_scale")
    return Outcome(NextViewResult(next_view=curves3d.next_view(plan)))
