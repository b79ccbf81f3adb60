"""The contracts travel as JSON and come back the same; what is not in them is refused."""

from __future__ import annotations

from typing import Any

import pytest
from dlo_client.contracts import (
    AnyJob,
    AnyRequest,
    ImagePart,
    ImageRef,
    InstancesRequest,
    Job,
    JobEvent,
    JobState,
    NoopRequest,
    NoopResult,
    RtDloParams,
    SegmentRequest,
)
from pydantic import TypeAdapter, ValidationError

from tests.clients import samples

REQUESTS = [
    NoopRequest(hold_s=1.5, priority="batch"),
    SegmentRequest(image=ImageRef(id=samples.SHA), threshold=0.25, label="desk"),
    InstancesRequest(image=ImagePart(part=1), mask=ImagePart(part=0)),
    InstancesRequest(params=RtDloParams(neighbors=4), points_per_instance=20, files=["mask"]),
]


@pytest.mark.parametrize("request_", REQUESTS, ids=lambda request: request.kind)
def test_a_request_comes_back_as_its_kind(request_: NoopRequest) -> None:
    back = TypeAdapter(AnyRequest).validate_json(request_.model_dump_json())
    assert type(back) is type(request_)
    assert back == request_


@pytest.mark.parametrize(
    "job",
    [
        samples.job(),
        samples.instances_job(),
        samples.failed(samples.bad_threshold()),
        samples.job(JobState.QUEUED),
    ],
    ids=["noop", "instances", "failed", "queued"],
)
def test_a_job_comes_back_with_its_result(job: Job[Any]) -> None:
    back = AnyJob.model_validate_json(job.model_dump_json())
    assert type(back.result) is type(job.result)
    assert back.model_dump() == job.model_dump()


def test_a_job_of_one_kind_refuses_the_result_of_another() -> None:
    with pytest.raises(ValidationError, match="kind"):
        Job[NoopResult].model_validate_json(samples.instances_job().model_dump_json())


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("threshold", float("nan")),
        ("threshold", float("inf")),
        ("threshold", -0.1),
        ("threshold", 1.1),
        ("timeout_s", 0),
        ("timeout_s", 1e9),
        ("points_per_instance", 1),
        ("points_per_instance", 10**9),
        ("method", "magic"),
        ("model", "../secrets"),
        ("image", {"id": "../secrets"}),
        ("image", {"part": 64}),
        ("params", {"neighbors": 10**9}),
        ("files", ["instances", "/etc/passwd"]),
        ("surprise", 1),
    ],
)
def test_a_bad_field_is_refused_by_name(field: str, value: object) -> None:
    with pytest.raises(ValidationError) as caught:
        InstancesRequest.model_validate({field: value})
    assert {error["loc"][0] for error in caught.value.errors()} == {field}


def test_a_network_is_not_chosen_for_a_given_mask() -> None:
    with pytest.raises(ValidationError, match="has no meaning beside `mask`"):
        InstancesRequest(mask=ImagePart(part=0), model="foreground")


@pytest.mark.parametrize("state", list(JobState))
def test_final_states_are_the_ends(state: JobState) -> None:
    assert state.final == (state.value in {"succeeded", "failed", "cancelled"})
    assert (
        JobEvent(id="1-0", state=state, progress=0).model_dump(mode="json")["state"] == state.value
    )


def test_values_do_not_change() -> None:
    with pytest.raises(ValidationError, match="frozen"):
        samples.job().state = JobState.QUEUED  # type: ignore[misc]


def test_a_result_s_repr_is_short() -> None:
    """Printing a result in a console wrote its masks and centerlines: megabytes."""
    scene = samples.two_cables()
    assert "instances=<2 Instance>" in repr(scene)
    assert len(repr(scene)) < 500
    assert len(repr(scene.instances[0])) < 900
    assert str(scene) == repr(scene)
    assert scene.model_validate_json(scene.model_dump_json()) == scene
