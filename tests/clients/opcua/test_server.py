"""The OPC UA server, called by asyncua's client over a socket, as a PLC or a SCADA system would."""

from __future__ import annotations

import asyncio
import json
import threading
from concurrent.futures import Future

import pytest

asyncua = pytest.importorskip("asyncua")

import httpx  # noqa: E402
from dlo_client import AsyncClient, RetryPolicy  # noqa: E402
from dlo_client.bridge.server import bridge  # noqa: E402
from dlo_client.bridge.settings import BridgeSettings  # noqa: E402
from dlo_client.contracts.recipes import Recipe  # noqa: E402
from dlo_client.opcua.address_space import NAMESPACE  # noqa: E402

from tests.clients import samples  # noqa: E402
from tests.clients.bridge.recipe_service import RecipeService  # noqa: E402
from workers.embedded import free_port  # noqa: E402

LOOKS = 3000
"""For what is to come, 20 ms apart: how long it takes is not what is tested."""


class Service(RecipeService):
    """Also lists its recipes, and may be away."""

    away = False

    def client(self) -> AsyncClient:
        return AsyncClient(
            "http://service",
            transport=httpx.MockTransport(self._all),
            retry=RetryPolicy(attempts=1),
        )

    async def _all(self, request: httpx.Request) -> httpx.Response:
        if self.away:
            raise httpx.ConnectError("away")
        if request.method == "POST":
            return await self._answer(request)
        made = samples.job().created_at
        recipes = [
            Recipe(number=n, version=3, name=name, created_at=made, request={"kind": "noop"})
            for n, name in ((7, "cables"), (8, "broken"), (9, "slow"))
        ]
        return httpx.Response(200, json=[recipe.model_dump(mode="json") for recipe in recipes])


class Plc:
    """Calls methods and reads states by their browse names."""

    def __init__(self, client, index: int) -> None:
        self._client, self._index = client, index
        self.events: list[str] = []

    async def node(self, *path: str):
        return await self._client.nodes.objects.get_child(
            [f"{self._index}:{name}" for name in ("VisionSystem", *path)]
        )

    async def call(self, holder: tuple[str, ...], method: str, *arguments: str):
        parent = await self.node(*holder)
        return await parent.call_method(f"{self._index}:{method}", *arguments)

    async def machine(self, method: str):
        return await self.call(("VisionStateMachine",), method)

    async def automatic(self, method: str, *arguments: str):
        return await self.call(
            ("VisionStateMachine", "AutomaticModeStateMachine"), method, *arguments
        )

    async def recipe(self, method: str, name: str):
        return await self.call(("RecipeManagement",), method, name)

    async def state(self) -> str:
        nodes = [
            await self.node("VisionStateMachine", *deeper, "CurrentState")
            for deeper in ((), (_AUTO,))
        ]
        upper, automatic = [(await node.read_value()).Text or "" for node in nodes]
        return f"{upper}/{automatic}"

    async def comes_to(self, state: str) -> None:
        for _ in range(LOOKS):
            if await self.state() == state:
                return
            await asyncio.sleep(0.02)
        raise AssertionError(f"{await self.state()} instead of {state}")

    async def comes_to_result(self, job_id: str) -> None:
        for _ in range(LOOKS):
            if await _latest(self, "JobId") == job_id:
                return
            await asyncio.sleep(0.02)
        raise AssertionError(f"no result of {job_id}")

    def event_notification(self, event) -> None:
        self.events.append(f"{event.Message.Text}")


_AUTO = "AutomaticModeStateMachine"


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    """One server for all tests: to make one takes seconds. Gives the loop that it runs on, a PLC,
    and the service."""
    picture = tmp_path_factory.mktemp("opcua") / "picture.png"
    picture.write_bytes(b"picture")
    settings = BridgeSettings.model_validate(
        {"opcua": {"port": free_port()}, "picture": {"file": picture}}
    )
    started: Future = Future()

    async def run() -> None:
        service, stop = Service(), asyncio.Event()
        address = f"opc.tcp://127.0.0.1:{settings.opcua.port}/dlo"
        async with (
            service.client() as client,
            bridge(settings, client),
            asyncua.Client(address, timeout=30) as connection,
        ):
            plc = Plc(connection, await connection.get_namespace_index(NAMESPACE))
            started.set_result((asyncio.get_running_loop(), plc, service, stop))
            await stop.wait()

    thread = threading.Thread(target=lambda: asyncio.run(run()), daemon=True)
    thread.start()
    loop, plc, service, stop = started.result(60)
    yield loop, plc, service
    loop.call_soon_threadsafe(stop.set)
    thread.join(30)


@pytest.fixture
def talk(session):
    """Runs ``scenario(plc, service)``; the system begins and ends in Preoperational."""
    loop, plc, service = session

    async def from_the_start(scenario):
        if await plc.state() != "Preoperational/":
            await plc.machine("Reset")
            await plc.comes_to("Preoperational/")
        service.go.clear()
        await asyncio.wait_for(scenario(plc, service), 60)

    return lambda scenario: asyncio.run_coroutine_threadsafe(from_the_start(scenario), loop).result(
        90
    )


def test_a_single_job_from_start_to_result(talk):
    async def scenario(plc, _):
        assert await plc.state() == "Preoperational/"
        assert await plc.machine("SelectModeAutomatic") == 0
        await plc.comes_to("Operational/Initialized")
        assert await plc.automatic("StartSingleJob", "m", "p", "", "") == ["", 1], (
            "no recipe is prepared"
        )
        assert await plc.recipe("PrepareRecipe", "77") == ["", 2]
        assert await plc.recipe("PrepareRecipe", "7") == ["7.3", 0]
        await plc.comes_to("Operational/Ready")
        job_id, error = await plc.automatic("StartSingleJob", "meas 1", "part 12", "7", "")
        assert error == 0
        assert len(job_id) == 32
        await plc.comes_to("Operational/Ready")
        await plc.comes_to_result(job_id)
        content = json.loads(await _latest(plc, "ResultContent"))
        assert content["status"] == 0
        assert len(content["poses"]) == 3
        assert await _latest(plc, "PartId") == "part 12"
        assert await _latest(plc, "JobId") == job_id
        assert await _latest(plc, "InternalRecipeId") == "7.3"
        assert await _latest(plc, "ResultState") == 1
        result_id = await _latest(plc, "ResultId")
        kept, error = await plc.call(("ResultManagement",), "GetResultById", result_id)
        assert (json.loads(kept)["MeasId"], error) == ("meas 1", 0)
        assert (await plc.call(("ResultManagement",), "GetResultById", "none"))[1] == 2
        assert await plc.call(("ResultManagement",), "GetResultListFiltered", "meas 1", "") == [
            [result_id],
            0,
        ]
        listed = await (await plc.node("RecipeManagement", "Recipes")).read_value()
        assert listed == ["7: cables", "8: broken", "9: slow"]

    talk(scenario)


async def _latest(plc: Plc, name: str):
    """As soon as there is a result."""
    node = await plc.node("ResultManagement", "LatestResult", name)
    for _ in range(LOOKS):
        if (value := await node.read_value()) not in ("", 0, None):
            return value
        await asyncio.sleep(0.02)
    raise AssertionError(f"{name} stays empty")


def test_every_transition_that_a_method_causes(talk):
    async def scenario(plc, service):
        seen = []

        async def after(call, state):
            assert await call == 0
            await plc.comes_to(state)
            seen.append(state)

        await after(plc.machine("Halt"), "Halted/")
        assert await plc.machine("SelectModeAutomatic") == 1
        await after(plc.machine("Reset"), "Preoperational/")
        assert await plc.machine("Reset") == 1
        await after(plc.machine("SelectModeAutomatic"), "Operational/Initialized")
        assert (await plc.recipe("PrepareProduct", "cables"))[1] == 0
        await plc.comes_to("Operational/Ready")
        await after(plc.recipe("UnprepareProduct", "cables"), "Operational/Initialized")
        assert (await plc.recipe("PrepareRecipe", "9"))[1] == 0
        assert (await plc.recipe("PrepareRecipe", "7"))[1] == 0
        await after(plc.recipe("UnprepareRecipe", "7"), "Operational/Ready")
        assert await plc.recipe("UnprepareRecipe", "7") == 2
        assert (await plc.automatic("StartSingleJob", "", "", "9", ""))[1] == 0
        await plc.comes_to("Operational/SingleExecution")
        assert (await plc.automatic("StartSingleJob", "", "", "9", ""))[1] == 1
        await after(plc.automatic("Abort"), "Operational/Ready")
        assert await plc.automatic("Abort") == 1
        assert await plc.automatic("Stop") == 1
        assert (await plc.automatic("StartContinuous", "", "", "9", ""))[1] == 0
        await plc.comes_to("Operational/ContinuousExecution")
        await after(plc.automatic("Abort"), "Operational/Ready")
        service.go.set()
        assert (await plc.automatic("StartContinuous", "", "", "9", ""))[1] == 0
        await plc.comes_to("Operational/ContinuousExecution")
        await after(plc.automatic("Stop"), "Operational/Ready")
        await after(plc.recipe("UnprepareRecipe", "9"), "Operational/Initialized")
        await after(plc.machine("Halt"), "Halted/")
        assert await plc.machine("ConfirmAll") == 1

    talk(scenario)


def test_a_service_that_is_away_is_an_error_and_resolves_itself(talk):
    async def scenario(plc, service):
        await plc.machine("SelectModeAutomatic")
        await plc.recipe("PrepareRecipe", "7")
        service.away = True
        await plc.automatic("StartSingleJob", "", "", "", "")
        await plc.comes_to("Error/")
        assert await plc.machine("ConfirmAll") == 0
        service.away = False
        await plc.comes_to("Preoperational/")

    talk(scenario)


def test_events_reach_a_subscriber(talk):
    async def scenario(plc, _):
        subscription = await plc._client.create_subscription(20, plc)
        await subscription.subscribe_events(await plc.node())
        await plc.machine("SelectModeAutomatic")
        await plc.recipe("PrepareRecipe", "7")
        job_id, _ = await plc.automatic("StartSingleJob", "m", "p", "7", "")
        await plc.comes_to_result(job_id)
        for _ in range(LOOKS):
            if any("ResultState 1" in event for event in plc.events):
                break
            await asyncio.sleep(0.02)
        text = "\n".join(plc.events)
        assert "Transition PreoperationalToInitialized" in text
        assert "InternalId 7.3" in text
        assert "ResultState 1" in text

    talk(scenario)
