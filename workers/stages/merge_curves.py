"""``merge_curves``: sections of one DLO to one filtered curve."""

from __future__ import annotations

from dlo_client.contracts import MergeCurvesRequest, MergeCurvesResult

from models.reconstruction.merging import MergeParams, NotOneDlo, merge
from workers.stages import curves3d
from workers.stages.outcome import InvalidInput, Outcome


def run(request: MergeCurvesRequest) -> Outcome:
    sections = [curves3d.decode(curve, f"curves.{k}") for k, curve in enumerate(request.curves)]
    try:
        merged = merge(sections, MergeParams(window_m=request.window_m, spacing_m=request.spacing_m))
    except NotOneDlo as error:
        raise InvalidInput(f"curves.{error.section}", str(error), "invalid_curve") from error
    result = MergeCurvesResult(
        curve=curves3d.encode(merged.curve),
        disagreement_m=round(merged.disagreement_m, 6),
        outliers=merged.outliers,
    )
    files = {"curve.ply": curves3d.ply_file([merged.curve]), "curve.csv": curves3d.csv_file([merged.curve])}
    return Outcome(result, files)
