"""The stand-in for the service that the benches of reconstruction scan with."""

from __future__ import annotations

import pytest
from dlo_client import JobFailed
from dlo_client.contracts import ImageRef, InstancesRequest, NoopRequest, NoopResult

from tests.benchmarks import cable_cell


@pytest.mark.slow
def test_it_answers_as_the_client_does() -> None:
    """The client's ``run`` gave the result, the stand-in a job: no scan could be measured."""
    service = cable_cell.InProcess(cable_cell.tools())
    assert isinstance(service.run(NoopRequest()), NoopResult)
    with pytest.raises(JobFailed):
        service.run(InstancesRequest(image=ImageRef(id="0" * 64)))
