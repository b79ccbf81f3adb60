"""``merge_curves``: sections of one DLO to one filtered curve."""

from __future__ import annotations

from dataclasses import replace

from dlo_client.contracts import MergeCurvesRequest, MergeCurvesResult
from dlo_client.contracts.reconstruction import MOST_POINTS

from models.reconstruction.merging import MergeParams, NotMergeable, merge
from workers.stages import curves3d
from workers.stages.outcome import InvalidInput, Outcome


def run(request: MergeCurvesRequest) -> Outcome:
    sections = [curves3d.decode(curve, f"curves.{k}") for k, curve in enumerate(request.curves)]
    params = MergeParams(window_m=request.window_m, points=MOST_POINTS)
    if request.spacing_m is not None:
        params = replace(params, spacing_m=request.spacing_m, coarser=False)
    try:
        merged = merge(sections, params)
    except NotMergeable as error:
        field = error.about if error.section is None else f"{error.about}.{error.section}"
        raise InvalidInput(field, str(error), "invalid_curve") from error
    result = MergeCurvesResult(
        curve=curves3d.encode(merged.curve),
        disagreement_m=round(merged.disagreement_m, 6),
        outliers=merged.outliers,
    )
    files = {
        "curve.ply": curves3d.ply_file([merged.curve]),
        "curve.csv": curves3d.csv_file([merged.curve]),
    }
    return Outcome(result, files)
