"""What a request leaves out has one value: the contract's default is the model's."""

from __future__ import annotations

from dataclasses import MISSING, fields
from typing import Any

import pytest
from dlo_client.contracts import (
    AriadnePlusParams,
    DisentangleRequest,
    FastDloParams,
    LabelTrackedRequest,
    MergeCurvesRequest,
    NextViewRequest,
    ReconstructRequest,
    RtDloParams,
    SectionMatchingParams,
)
from pydantic import BaseModel

from models.disentangling.plan import DisentangleParams
from models.instances import section_matching
from models.instances.published import ariadne_plus, fastdlo, rt_dlo
from models.reconstruction.merging import MergeParams
from models.reconstruction.published.dlo3ds import Dlo3dsParams
from models.reconstruction.reconstruct import ReconstructParams
from models.reconstruction.view_planning import PlanParams
from models.tracked_labels.tracked import TrackedParams

PAIRS: list[tuple[type[BaseModel], type, dict[str, str]]] = [
    (SectionMatchingParams, section_matching.SectionMatchingParams, {}),
    (RtDloParams, rt_dlo.RtDloParams, {}),
    (FastDloParams, fastdlo.FastDloParams, {}),
    (AriadnePlusParams, ariadne_plus.AriadnePlusParams, {}),
    (ReconstructRequest, ReconstructParams, {}),
    (ReconstructRequest, Dlo3dsParams, {}),
    (NextViewRequest, PlanParams, {"pictures": "views"}),
    (MergeCurvesRequest, MergeParams, {}),
    (DisentangleRequest, DisentangleParams, {}),
    (LabelTrackedRequest, TrackedParams, {}),
]


@pytest.mark.parametrize(
    ("contract", "params", "renamed"), PAIRS, ids=lambda p: getattr(p, "__name__", "")
)
def test_both_have_one_default(contract, params, renamed):
    """``at_most`` was 5 for clients and 8 for who called the planner."""
    ours: dict[str, Any] = {f.name: f.default for f in fields(params) if f.default is not MISSING}
    shared = {
        name: ours[renamed.get(name, name)]
        for name, field in contract.model_fields.items()
        if renamed.get(name, name) in ours and field.default is not None
    }
    assert shared
    assert {name: contract.model_fields[name].default for name in shared} == shared
