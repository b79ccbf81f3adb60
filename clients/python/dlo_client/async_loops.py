"""The twins of :class:`Scan` and :class:`ShapeController` for an event loop.

Strategy: there is one algorithm, the blocking one. It runs in a thread; what it asks of the client,
and of a robot whose methods are coroutines, is done on the caller's loop while the thread waits. A
robot with ordinary methods is called in that thread, where it holds up nobody. When the caller is
cancelled, the next thing that the thread asks for ends it.
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import AsyncIterator, Callable, Coroutine
from threading import Event
from typing import Any, TypeVar

from dlo_client.async_client import AsyncClient
from dlo_client.contracts import DloObject, JobRequest, PlanShapeResult
from dlo_client.contracts.base import ResultT
from dlo_client.errors import DLOError, InvalidArgument
from dlo_client.pictures import Pictures
from dlo_client.scan import Scan, ScanOptions, ScanResult
from dlo_client.shape_control import Points, ShapeController, ShapeOutcome, Step

T = TypeVar("T")
_END = object()


class _Abandoned(DLOError):
    """The caller no longer waits."""


class _Bridge:
    """Runs coroutines of a thread on the loop."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._abandoned = Event()

    def call(self, function: Callable[..., Any], *args: Any) -> Any:
        """What ``function`` gives, in the thread or, for a coroutine, on the loop."""
        if self._abandoned.is_set():
            raise _Abandoned("the caller no longer waits")
        made = function(*args)
        if not inspect.iscoroutine(made):
            return made
        return asyncio.run_coroutine_threadsafe(made, self._loop).result()

    async def run(self, work: Callable[[], T]) -> T:
        """``work`` in a thread."""
        try:
            return await asyncio.to_thread(work)
        except asyncio.CancelledError:
            self._abandoned.set()
            raise


class _BlockingClient:
    """The part of Client that the loops use."""

    def __init__(self, client: AsyncClient, bridge: _Bridge) -> None:
        self._client = client
        self._bridge = bridge

    def run(self, request: JobRequest[ResultT], image: Pictures | None = None, /) -> ResultT:
        made: Callable[..., Coroutine[Any, Any, ResultT]] = self._client.run
        result: ResultT = self._bridge.call(made, request, image)
        return result


class _Blocking:
    """A robot's methods as they look from the thread; other attributes as they are."""

    def __init__(self, robot: Any, bridge: _Bridge) -> None:
        self._robot = robot
        self._bridge = bridge

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._robot, name)
        if not callable(value):
            return value
        return lambda *args: self._bridge.call(value, *args)


class AsyncScan:
    """As :class:`Scan`: ``arm`` has its methods, as coroutines or as ordinary ones."""

    def __init__(
        self,
        client: AsyncClient,
        arm: Any,
        options: ScanOptions | None = None,
        target_xy: tuple[float, float] | None = None,
    ) -> None:
        _awaiting(client, type(self).__name__)
        self._client, self._arm = client, arm
        self._options, self._target_xy = options, target_xy

    async def run(self) -> ScanResult:
        """The whole cable, from the middle to one end, then to the other."""
        bridge = _Bridge()
        client = _BlockingClient(self._client, bridge)
        arm = _Blocking(self._arm, bridge)
        return await bridge.run(lambda: Scan(client, arm, self._options, self._target_xy).run())


class AsyncShapeController:
    """As :class:`ShapeController`, whose options it takes; ``robot`` has its methods, as coroutines
    or ordinary."""

    def __init__(
        self,
        client: AsyncClient,
        robot: Any,
        dlo: DloObject,
        target_m: Points | None,
        **options: Any,
    ) -> None:
        _awaiting(client, type(self).__name__)
        self._bridge: _Bridge | None = None
        self._client, self._robot = client, robot
        self._arguments = (dlo, target_m)
        self._options = options
        self._controller: ShapeController | None = None

    async def run(self) -> ShapeOutcome:
        """Act until the target is reached, no action helps, or the actions are used up."""
        bridge, controller = self._started()
        return await bridge.run(controller.run)

    async def steps(self) -> AsyncIterator[Step]:
        """The loop, a step at a time."""
        bridge, controller = self._started()
        steps = controller.steps()
        while True:
            step: Any = await bridge.run(lambda: next(steps, _END))
            if step is _END:
                return
            yield step

    async def plan(self, state_m: Points) -> PlanShapeResult:
        """What to do next, from this state and all that is remembered."""
        bridge, controller = self._started()
        return await bridge.run(lambda: controller.plan(state_m))

    def _started(self) -> tuple[_Bridge, ShapeController]:
        """Made on first use, when the loop runs."""
        if self._bridge is None or self._controller is None:
            self._bridge = _Bridge()
            client: Any = _BlockingClient(self._client, self._bridge)
            robot: Any = _Blocking(self._robot, self._bridge)
            self._controller = ShapeController(client, robot, *self._arguments, **self._options)
        return self._bridge, self._controller


def _awaiting(client: Any, who: str) -> None:
    if not inspect.iscoroutinefunction(getattr(client, "run", None)):
        raise InvalidArgument("client", f"{who} awaits answers: give it an AsyncClient")
