"""The vision system behind the OPC UA nodes: methods, jobs through recipes, results and events.

``Error`` of a method: 0 is done; 1 the state does not allow it; 2 an argument is wrong or unknown;
-1 the service did not answer. ``ResultState``: 1 complete, 2 failed, 3 aborted.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
from collections import OrderedDict
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any
from uuid import uuid4

from asyncua import ua

from dlo_client.async_client import AsyncClient
from dlo_client.bridge.cell import NoPictureError, TakePicture
from dlo_client.bridge.settings import JobsSection
from dlo_client.bridge.status import Status, of_error, of_job
from dlo_client.errors import DLOError
from dlo_client.opcua.address_space import Signature, VisionNodes
from dlo_client.opcua.state_machine import (
    AUTOMATIC_STATES,
    STATES,
    VisionMachine,
    WrongStateError,
)

OK, WRONG_STATE, WRONG_ARGUMENT, SERVICE_AWAY = 0, 1, 2, -1
COMPLETE, FAILED, ABORTED = 1, 2, 3
_RESULTS_KEPT = 100
_LOOK_EVERY_S = 1.0

log = logging.getLogger(__name__)


@dataclass
class VisionJob:
    """A single or continuous job, as StartSingleJob and StartContinuous begin it."""

    meas_id: str
    part_id: str
    recipe: int
    job_id: str = field(default_factory=lambda: uuid4().hex)


class VisionSystem:
    """Runs prepared recipes; one job at a time, as the standard's state machine has it."""

    def __init__(self, client: AsyncClient, take_picture: TakePicture, jobs: JobsSection) -> None:
        self._client = client
        self._take = take_picture
        self._timeout_s = jobs.timeout_s
        self._happened: asyncio.Queue[tuple[str, str, str]] = asyncio.Queue()
        self.machine = VisionMachine(lambda *change: self._happened.put_nowait(change))
        self._prepared: dict[str, int] = {}
        self._results: OrderedDict[str, dict[str, Any]] = OrderedDict()
        self._task: asyncio.Task[None] | None = None
        self._stopping = False
        self._nodes: VisionNodes

    def methods(self) -> dict[str, list[Signature]]:
        """By the object that has them."""
        start = ("MeasId", "PartId", "RecipeId", "ProductId")
        return {
            "VisionStateMachine": [
                Signature("Halt", self.halt),
                Signature("Reset", self.reset),
                Signature("SelectModeAutomatic", self.select_automatic),
                Signature("ConfirmAll", self.confirm_all),
            ],
            "AutomaticModeStateMachine": [
                Signature("StartSingleJob", self.start_single, start, ("JobId", "Error")),
                Signature("StartContinuous", self.start_continuous, start, ("JobId", "Error")),
                Signature("Stop", self.stop),
                Signature("Abort", self.abort),
            ],
            "RecipeManagement": [
                Signature("PrepareRecipe", self.prepare, ("ExternalId",), ("InternalId", "Error")),
                Signature("UnprepareRecipe", self.unprepare, ("ExternalId",)),
                Signature(
                    "PrepareProduct", self.prepare_product, ("ProductId",), ("InternalId", "Error")
                ),
                Signature("UnprepareProduct", self.unprepare_product, ("ProductId",)),
            ],
            "ResultManagement": [
                Signature("GetResultById", self.result_by_id, ("ResultId",), ("Result", "Error")),
                Signature(
                    "GetResultListFiltered",
                    self.result_list,
                    ("MeasId", "PartId"),
                    ("ResultIdList", "Error"),
                ),
            ],
        }

    async def run(self, nodes: VisionNodes) -> None:
        """Write what happens to the nodes, and look after the service, until cancelled."""
        self._nodes = nodes
        looking = asyncio.create_task(self._look_after_service())
        try:
            while True:
                await self._write(*(await self._happened.get()))
        finally:
            looking.cancel()
            await self._end_task()

    async def halt(self) -> list[Any]:
        return [await self._leave(f"{self.machine.state}ToHalted")]

    async def reset(self) -> list[Any]:
        if self.machine.state == "Preoperational":
            return [WRONG_STATE]
        return [await self._leave(f"{self.machine.state}ToPreoperational")]

    async def select_automatic(self) -> list[Any]:
        return [self._fire("PreoperationalToInitialized")]

    async def confirm_all(self) -> list[Any]:
        """Errors that need a person: there are none that the server could not tell by itself."""
        return [OK if self.machine.state == "Error" else WRONG_STATE]

    async def prepare(self, external_id: str) -> list[Any]:
        """A recipe by its number; several may be prepared."""
        return await self._prepare(external_id, "InitializedToReadyRecipe")

    async def prepare_product(self, product_id: str) -> list[Any]:
        """A product is the recipe of that name."""
        return await self._prepare(product_id, "InitializedToReadyProduct")

    async def unprepare(self, external_id: str) -> list[Any]:
        return [self._unprepare(external_id, "ReadyToInitializedRecipe")]

    async def unprepare_product(self, product_id: str) -> list[Any]:
        return [self._unprepare(product_id, "ReadyToInitializedProduct")]

    async def start_single(
        self, meas_id: str, part_id: str, recipe_id: str, product_id: str
    ) -> list[Any]:
        return self._start(
            VisionJob(meas_id or "", part_id or "", 0), recipe_id or product_id, single=True
        )

    async def start_continuous(
        self, meas_id: str, part_id: str, recipe_id: str, product_id: str
    ) -> list[Any]:
        return self._start(
            VisionJob(meas_id or "", part_id or "", 0), recipe_id or product_id, single=False
        )

    async def stop(self) -> list[Any]:
        """Finish the picture that is under way, then be ready."""
        if not self.machine.executing or self._task is None:
            return [WRONG_STATE]
        self._stopping = True
        await asyncio.wait({self._task})
        return [OK]

    async def abort(self) -> list[Any]:
        """End now; the result of the picture under way is lost."""
        if not self.machine.executing:
            return [WRONG_STATE]
        state = self.machine.automatic
        await self._end_task()
        if self.machine.automatic == state:
            self.machine.fire(f"{state}ToReadyAbort")
        return [OK]

    async def result_by_id(self, result_id: str) -> list[Any]:
        found = self._results.get(result_id)
        return ["", WRONG_ARGUMENT] if found is None else [json.dumps(found, default=str), OK]

    async def result_list(self, meas_id: str, part_id: str) -> list[Any]:
        """Newest last; an empty id is any."""
        kept = [
            name
            for name, result in self._results.items()
            if meas_id in ("", None, result["MeasId"]) and part_id in ("", None, result["PartId"])
        ]
        return [kept, OK]

    async def _prepare(self, name: str, transition: str) -> list[Any]:
        if self.machine.automatic not in ("Initialized", "Ready"):
            return ["", WRONG_STATE]
        try:
            stored = await self._client.recipes()
        except DLOError:
            return ["", SERVICE_AWAY]
        found = next((one for one in stored if name in (str(one.number), one.name)), None)
        if found is None:
            return ["", WRONG_ARGUMENT]
        self._prepared[name] = found.number
        internal = f"{found.number}.{found.version}"
        if self.machine.automatic == "Initialized":
            self.machine.fire(transition)
        await self._trigger("RecipePreparedEventType", ExternalId=name, InternalId=internal)
        return [internal, OK]

    def _unprepare(self, name: str, transition: str) -> int:
        if self.machine.automatic != "Ready":
            return WRONG_STATE
        if self._prepared.pop(name, None) is None:
            return WRONG_ARGUMENT
        if not self._prepared:
            self.machine.fire(transition)
        return OK

    def _start(self, job: VisionJob, name: str, *, single: bool) -> list[Any]:
        if self.machine.automatic != "Ready":
            return ["", WRONG_STATE]
        chosen = self._prepared.get(name) if name else next(iter(self._prepared.values()), None)
        if chosen is None:
            return ["", WRONG_ARGUMENT]
        job.recipe = chosen
        self._stopping = False
        self.machine.fire("ReadyToSingleExecution" if single else "ReadyToContinuousExecution")
        self._task = asyncio.create_task(self._execute(job, single))
        return [job.job_id, OK]

    async def _execute(self, job: VisionJob, single: bool) -> None:
        state = self.machine.automatic
        ids = {"JobId": job.job_id, "MeasId": job.meas_id, "PartId": job.part_id}
        await self._trigger("JobStartedEventType", **ids, RecipeId=str(job.recipe))
        while True:
            status = await self._one_picture(job, ids)
            if status is Status.SERVICE_AWAY and self.machine.state == "Operational":
                self.machine.fire("OperationalToErrorAuto")
                await self._trigger(
                    "ErrorEventType", CauseDescription="the service does not answer"
                )
                return
            if single or self._stopping or status >= Status.UNKNOWN_COMMAND:
                break
        if self.machine.automatic == state:
            self.machine.fire(f"{state}ToReady{'Stop' if self._stopping else 'Auto'}")
        await self._trigger("ReadyEventType", JobId=job.job_id)

    async def _one_picture(self, job: VisionJob, ids: dict[str, str]) -> Status:
        started = datetime.now(UTC)
        version, poses = 0, []
        try:
            picture = await self._take()
            await self._trigger("AcquisitionDoneEventType", JobId=job.job_id)
            done = await self._client.run_recipe(job.recipe, picture, timeout=self._timeout_s)
            status = of_job(done)
            version = done.recipe.version if done.recipe else 0
            poses = [pose.model_dump() for pose in done.poses.poses] if done.poses else []
        except NoPictureError:
            status = Status.NO_PICTURE
        except Exception as error:
            status = of_error(error)
        result = {
            **ids,
            "ResultId": uuid4().hex,
            "InternalRecipeId": f"{job.recipe}.{version}",
            "ResultState": FAILED if status >= Status.UNKNOWN_COMMAND else COMPLETE,
            "IsPartial": False,
            "IsSimulated": False,
            "CreationTime": started,
            "ProcessingTime": (datetime.now(UTC) - started).total_seconds() * 1000,
            "ResultContent": json.dumps({"status": int(status), "poses": poses}),
        }
        await self._keep(result, ids)
        return status

    async def _keep(self, result: dict[str, Any], ids: dict[str, str]) -> None:
        self._results[result["ResultId"]] = result
        while len(self._results) > _RESULTS_KEPT:
            self._results.popitem(last=False)
        for name, node in self._nodes.result.items():
            await node.write_value(result[name], await node.read_data_type_as_variant_type())
        fields = {"ResultId": result["ResultId"], "RecipeId": result["InternalRecipeId"]}
        await self._trigger(
            "ResultReadyEventType", **ids, **fields, ResultState=result["ResultState"]
        )

    async def _leave(self, transition: str) -> int:
        """Out of a state of the upper machine: a job under way ends."""
        await self._end_task()
        self._prepared.clear()
        return self._fire(transition)

    def _fire(self, transition: str) -> int:
        try:
            self.machine.fire(transition)
        except (WrongStateError, KeyError):
            return WRONG_STATE
        return OK

    async def _end_task(self) -> None:
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
            self._task = None

    async def _look_after_service(self) -> None:
        """Error while nobody answers, Preoperational once somebody does; recipes are listed
        meanwhile."""
        while True:
            try:
                stored = await self._client.recipes()
                names = [f"{one.number}: {one.name}" for one in stored]
                await self._nodes.recipes.write_value(ua.Variant(names, ua.VariantType.String))
                if self.machine.state == "Error":
                    self.machine.fire("ErrorToPreoperationalAuto")
                    await self._trigger(
                        "ErrorResolvedEventType", CauseDescription="the service answers again"
                    )
            except DLOError as error:
                if self.machine.state == "Preoperational":
                    self.machine.fire("PreoperationalToErrorAuto")
                    await self._trigger("ErrorEventType", CauseDescription=str(error)[:200])
            await asyncio.sleep(_LOOK_EVERY_S)

    async def _write(self, transition: str, source: str, target: str) -> None:
        nodes = self._nodes
        machine = self.machine
        await nodes.state.write_value(ua.LocalizedText(machine.state))
        await nodes.state_number.write_value(STATES[machine.state], ua.VariantType.UInt32)
        await nodes.automatic.write_value(ua.LocalizedText(machine.automatic))
        await nodes.automatic_number.write_value(
            AUTOMATIC_STATES.get(machine.automatic, 0), ua.VariantType.UInt32
        )
        await nodes.transition.write_value(ua.LocalizedText(transition))
        log.info("%s: %s to %s", transition, source, target)
        await self._trigger(
            "StateChangedEventType", Transition=transition, FromState=source, ToState=target
        )

    async def _trigger(self, kind: str, **fields: Any) -> None:
        generator = self._nodes.events[kind]
        for name, value in fields.items():
            setattr(generator.event, name, value)
        generator.event.Message = ua.LocalizedText(
            ", ".join(f"{name} {value}" for name, value in fields.items())
        )
        await generator.trigger()
