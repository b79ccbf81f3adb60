"""The standard's state machines: every transition from its state, and from no other."""

from __future__ import annotations

import pytest
from dlo_client.opcua.state_machine import (
    AUTOMATIC_STATES,
    AUTOMATIC_TRANSITIONS,
    STATES,
    TRANSITIONS,
    VisionMachine,
    WrongStateError,
)

WAY_TO = {
    "Preoperational": [],
    "Halted": ["PreoperationalToHalted"],
    "Error": ["PreoperationalToErrorAuto"],
    "Operational": ["PreoperationalToInitialized"],
}
WAY_TO |= {
    "Initialized": WAY_TO["Operational"],
    "Ready": [*WAY_TO["Operational"], "InitializedToReadyRecipe"],
}
WAY_TO |= {
    "SingleExecution": [*WAY_TO["Ready"], "ReadyToSingleExecution"],
    "ContinuousExecution": [*WAY_TO["Ready"], "ReadyToContinuousExecution"],
}


def machine_in(state: str) -> VisionMachine:
    machine = VisionMachine()
    for transition in WAY_TO[state]:
        machine.fire(transition)
    return machine


@pytest.mark.parametrize("transition", [*TRANSITIONS, *AUTOMATIC_TRANSITIONS])
def test_a_transition_leads_where_its_name_says(transition):
    automatic = transition in AUTOMATIC_TRANSITIONS
    source, target = (AUTOMATIC_TRANSITIONS if automatic else TRANSITIONS)[transition]
    machine = machine_in(source)
    machine.fire(transition)
    assert (machine.automatic if automatic else machine.state) == target
    assert transition.startswith(f"{source}To")


@pytest.mark.parametrize("state", [*STATES, *AUTOMATIC_STATES])
def test_no_other_transition_is_taken(state):
    upper = state if state in STATES else "Operational"
    for transition, (source, _) in (TRANSITIONS | AUTOMATIC_TRANSITIONS).items():
        machine = machine_in(state)
        if source not in (upper, machine.automatic):
            with pytest.raises(WrongStateError):
                machine.fire(transition)
            assert (machine.state, machine.automatic) == (upper, machine_in(state).automatic)


def test_halting_leaves_automatic_mode():
    machine = machine_in("SingleExecution")
    machine.fire("OperationalToHalted")
    assert (machine.state, machine.automatic, machine.executing) == ("Halted", "", False)
