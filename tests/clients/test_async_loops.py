"""The loops for an event loop: the same answers as the blocking ones, robots of both sorts."""

from __future__ import annotations

import asyncio

import httpx
import pytest
from dlo_client import (
    AsyncClient,
    AsyncScan,
    AsyncShapeController,
    Client,
    DloObject,
    InvalidArgument,
    Scan,
    ScanOptions,
)
from dlo_client.contracts import PlanShapeResult
from dlo_client.contracts.shape_plans import PlanStatus, UsedParameters

from tests.clients.test_scan import Arm, Table

OBJECT = DloObject(mass_kg=0.05)
LINE = [(0.0, 0.0), (0.1, 0.0), (0.2, 0.0)]


class AsyncTable(Table):
    """The service of the blocking tests, awaited."""

    async def run(self, request, image=None):
        await asyncio.sleep(0)
        return Table.run(self, request, image)


class AsyncArm(Arm):
    """An arm whose moves are coroutines."""

    async def move_to(self, pose):
        await asyncio.sleep(0)
        Arm.move_to(self, pose)


@pytest.mark.parametrize("arm", [Arm, AsyncArm])
def test_a_scan_is_that_of_the_blocking_loop(arm):
    expected = Scan(Table(), Arm(), ScanOptions(at_most=2)).run()
    found = asyncio.run(AsyncScan(AsyncTable(), arm(), ScanOptions(at_most=2)).run())
    assert found.merged == expected.merged
    assert found.ended == expected.ended


class Planner:
    """Plans nothing: the shape is reached."""

    def __init__(self) -> None:
        self.requests: list = []

    async def run(self, request, image=None):
        self.requests.append(request)
        parameters = UsedParameters.model_construct(k_b=1.0, k_d=1.0)
        status = PlanStatus.model_construct(code="done", message="reached")
        return PlanShapeResult.model_construct(
            action=None, error_before_m=0.0, converged=True, status=status, parameters=parameters
        )


class Robot:
    async def observe(self):
        return LINE

    async def execute(self, action):
        raise AssertionError("there is nothing to do")


def test_shape_control():
    async def scenario():
        controller = AsyncShapeController(Planner(), Robot(), OBJECT, LINE, threshold_m=0.02)
        steps = [step async for step in controller.steps()]
        outcome = await controller.run()
        plan = await controller.plan(LINE)
        return steps, outcome, plan, controller._client.requests

    steps, outcome, plan, requests = asyncio.run(scenario())
    assert steps == []
    assert outcome.reached
    assert plan.action is None
    assert {request.tolerance_m for request in requests} == {0.02}


def test_a_cancelled_caller_stops_the_robot():
    moves = []

    class Slow(Arm):
        async def move_to(self, pose):
            moves.append(pose)
            await asyncio.sleep(0.05)

    async def scenario():
        task = asyncio.create_task(AsyncScan(AsyncTable(), Slow()).run())
        while not moves:
            await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        count = len(moves)
        await asyncio.sleep(0.2)
        return len(moves) - count

    assert asyncio.run(scenario()) <= 1


def test_a_blocking_client_is_refused():
    transport = httpx.MockTransport(lambda _: httpx.Response(200))
    with pytest.raises(InvalidArgument, match="AsyncClient"):
        AsyncScan(Client("http://service", transport=transport), Arm())
    with pytest.raises(InvalidArgument, match="AsyncClient"):
        AsyncShapeController(Client("http://service", transport=transport), Robot(), OBJECT, LINE)
    assert AsyncScan(AsyncClient("http://service", transport=transport), Arm())
