"""A service that runs recipes at once, as a transport for an AsyncClient: what a bridge needs of
the real one."""

from __future__ import annotations

import asyncio

import httpx
from dlo_client import AsyncClient, RetryPolicy
from dlo_client.contracts import JobState, NoopResult
from dlo_client.contracts.frames import RobotPose, RobotPoses
from dlo_client.contracts.recipes import RecipeUsed

from tests.clients import samples

POSES = [
    RobotPose(role="first", id=1, position=(0.1, 0.2, 0.05), rotation=[0.0, 3.1, 0.0], score=0.9),
    RobotPose(
        role="middle", id=1, position=(0.25, -0.125, 0.05), rotation=[0.0, 3.1, 0.25], score=0.9
    ),
    RobotPose(role="last", id=1, position=(0.4, -0.3, 0.05), rotation=[0.0, 3.1, 0.5], score=0.9),
]


class RecipeService:
    """Recipe 7 succeeds with ``poses``; 8 fails; 9 takes until ``go``; 10 finds nothing; others are
    not there."""

    def __init__(self, rotation: str = "ur") -> None:
        self.poses = POSES
        self.rotation = rotation
        self.go = asyncio.Event()
        self.bodies: list[bytes] = []

    def client(self) -> AsyncClient:
        return AsyncClient(
            "http://service",
            transport=httpx.MockTransport(self._answer),
            retry=RetryPolicy(attempts=1),
        )

    async def _answer(self, request: httpx.Request) -> httpx.Response:
        number = int(request.url.path.split("/")[3])
        self.bodies.append(request.content)
        if number == 9:
            await self.go.wait()
        if number == 8:
            return self._job(
                state=JobState.FAILED, problem=samples.refused(422, code="invalid_image")
            )
        if number == 10:
            status = {"code": "none_found", "limit": 0.8, "reasons": []}
            empty = (
                samples.two_cables()
                .model_copy(update={"instances": [], "crossings": []})
                .model_dump()
            )
            return self._job(kind="instances", result=empty | {"status": status})
        if number not in (7, 9):
            return httpx.Response(
                404, text=samples.refused(404, code="unknown_recipe").model_dump_json()
            )
        poses = RobotPoses(
            frame="world", unit="m", rotation=self.rotation, of="flange", poses=self.poses
        )
        return self._job(
            poses=poses, recipe=RecipeUsed(number=number, version=3), result=NoopResult(held_s=0)
        )

    def _job(self, state: JobState = JobState.SUCCEEDED, **fields) -> httpx.Response:
        return httpx.Response(200, text=samples.job(state, **fields).model_dump_json())
