"""The nodes of the vision system: objects, variables, methods and event types, by the names of OPC
40100-1."""

from __future__ import annotations

from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any

from asyncua import ua
from asyncua.server.server import Server
from asyncua.ua.object_ids import ObjectIds

from dlo_client.opcua.state_machine import AUTOMATIC_STATES, STATES

NAMESPACE = "urn:dlo-perception:machine-vision"
Method = Callable[..., Coroutine[Any, Any, list[Any]]]
_EVENTS = {
    "StateChangedEventType": ["Transition", "FromState", "ToState"],
    "RecipePreparedEventType": ["ExternalId", "InternalId"],
    "JobStartedEventType": ["JobId", "MeasId", "PartId", "RecipeId"],
    "AcquisitionDoneEventType": ["JobId"],
    "ReadyEventType": ["JobId"],
    "ResultReadyEventType": ["ResultId", "JobId", "MeasId", "PartId", "RecipeId", "ResultState"],
    "ErrorEventType": ["CauseDescription"],
    "ErrorResolvedEventType": ["CauseDescription"],
}
_RESULT = {
    "ResultId": ua.VariantType.String,
    "JobId": ua.VariantType.String,
    "MeasId": ua.VariantType.String,
    "PartId": ua.VariantType.String,
    "InternalRecipeId": ua.VariantType.String,
    "ResultState": ua.VariantType.Int32,
    "IsPartial": ua.VariantType.Boolean,
    "IsSimulated": ua.VariantType.Boolean,
    "CreationTime": ua.VariantType.DateTime,
    "ProcessingTime": ua.VariantType.Double,
    "ResultContent": ua.VariantType.String,
}


@dataclass
class VisionNodes:
    """What the server writes to; ``events``: generators by the name of their type."""

    state: Any
    state_number: Any
    transition: Any
    automatic: Any
    automatic_number: Any
    recipes: Any
    result: dict[str, Any]
    events: dict[str, Any]


@dataclass(frozen=True)
class Signature:
    """A method: arguments in and out as (name, type)."""

    name: str
    call: Method
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ("Error",)


async def build(server: Server, methods: dict[str, list[Signature]]) -> VisionNodes:
    """The VisionSystem below Objects; ``methods`` by the object that has them."""
    index = await server.register_namespace(NAMESPACE)
    system = await server.nodes.objects.add_object(index, "VisionSystem")
    machine = await system.add_object(index, "VisionStateMachine")
    automatic = await machine.add_object(index, "AutomaticModeStateMachine")
    recipes = await system.add_object(index, "RecipeManagement")
    results = await system.add_object(index, "ResultManagement")
    holders = {
        "VisionStateMachine": machine,
        "AutomaticModeStateMachine": automatic,
        "RecipeManagement": recipes,
        "ResultManagement": results,
    }
    for name, signatures in methods.items():
        for signature in signatures:
            await _add_method(holders[name], index, signature)
    state, number, transition = await _state_variables(machine, index, "Preoperational", STATES)
    auto_state, auto_number, _ = await _state_variables(automatic, index, "", AUTOMATIC_STATES)
    listed = await recipes.add_variable(index, "Recipes", [], ua.VariantType.String)
    folder = await results.add_object(index, "LatestResult")
    result = {
        name: await folder.add_variable(index, name, _zero(kind), kind)
        for name, kind in _RESULT.items()
    }
    events = {
        name: await _event(server, index, system, name, fields) for name, fields in _EVENTS.items()
    }
    return VisionNodes(state, number, transition, auto_state, auto_number, listed, result, events)


async def _state_variables(
    machine: Any, index: int, state: str, states: dict[str, int]
) -> tuple[Any, Any, Any]:
    """CurrentState with its Number, LastTransition; and the state objects."""
    current = await machine.add_variable(index, "CurrentState", ua.LocalizedText(state))
    number = await current.add_property(
        index, "Number", states.get(state, 0), ua.VariantType.UInt32
    )
    transition = await machine.add_variable(index, "LastTransition", ua.LocalizedText(""))
    for name, value in states.items():
        node = await machine.add_object(index, name)
        await node.add_property(index, "StateNumber", value, ua.VariantType.UInt32)
    return current, number, transition


async def _add_method(holder: Any, index: int, signature: Signature) -> None:
    async def call(_parent: Any, *arguments: Any) -> list[ua.Variant]:
        found = await signature.call(*(argument.Value for argument in arguments))
        return [
            ua.Variant(value, _type(name))
            for name, value in zip(signature.outputs, found, strict=True)
        ]

    inputs = [_argument(name) for name in signature.inputs]
    outputs = [_argument(name) for name in signature.outputs]
    await holder.add_method(index, signature.name, call, inputs, outputs)


def _type(name: str) -> ua.VariantType:
    return ua.VariantType.Int32 if name in ("Error", "CauseOfError") else ua.VariantType.String


def _argument(name: str) -> ua.Argument:
    listed = name.endswith("List")
    return ua.Argument(
        Name=name,
        DataType=ua.NodeId(ua.Int32(_type(name).value)),
        ValueRank=1 if listed else -1,
        ArrayDimensions=[0] if listed else [],
        Description=ua.LocalizedText(name),
    )


async def _event(server: Server, index: int, system: Any, name: str, fields: list[str]) -> Any:
    properties = [
        (field, ua.VariantType.Int32 if field == "ResultState" else ua.VariantType.String)
        for field in fields
    ]
    kind = await server.create_custom_event_type(index, name, ObjectIds.BaseEventType, properties)
    return await server.get_event_generator(kind, system)


def _zero(kind: ua.VariantType) -> Any:
    from datetime import UTC, datetime

    return {
        ua.VariantType.String: "",
        ua.VariantType.Int32: 0,
        ua.VariantType.Boolean: False,
        ua.VariantType.Double: 0.0,
        ua.VariantType.DateTime: datetime(1970, 1, 1, tzinfo=UTC),
    }[kind]
