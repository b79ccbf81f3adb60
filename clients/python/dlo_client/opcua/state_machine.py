"""The state machines of OPC 40100-1: the vision system's (8.2) and automatic mode's (8.3), names as
there.

Automatic mode is what *Operational* consists of here: leaving Operational leaves it, and entering
it begins in Initialized. Transitions that end in ``Auto`` are the server's own; the others are
caused by the methods of the same tables.
"""

from __future__ import annotations

from collections.abc import Callable

STATES = {"Preoperational": 1, "Halted": 2, "Error": 3, "Operational": 4}
AUTOMATIC_STATES = {"Initialized": 5, "Ready": 6, "SingleExecution": 7, "ContinuousExecution": 8}
"""With the standard's StateNumbers."""

TRANSITIONS: dict[str, tuple[str, str]] = {
    "PreoperationalToHalted": ("Preoperational", "Halted"),
    "PreoperationalToHaltedAuto": ("Preoperational", "Halted"),
    "PreoperationalToErrorAuto": ("Preoperational", "Error"),
    "PreoperationalToOperational": ("Preoperational", "Operational"),
    "PreoperationalToOperationalAuto": ("Preoperational", "Operational"),
    "PreoperationalToInitialized": ("Preoperational", "Operational"),
    "PreoperationalToInitializedAuto": ("Preoperational", "Operational"),
    "HaltedToPreoperational": ("Halted", "Preoperational"),
    "HaltedToPreoperationalAuto": ("Halted", "Preoperational"),
    "ErrorToPreoperational": ("Error", "Preoperational"),
    "ErrorToPreoperationalAuto": ("Error", "Preoperational"),
    "ErrorToHalted": ("Error", "Halted"),
    "ErrorToHaltedAuto": ("Error", "Halted"),
    "OperationalToPreoperational": ("Operational", "Preoperational"),
    "OperationalToPreoperationalAuto": ("Operational", "Preoperational"),
    "OperationalToHalted": ("Operational", "Halted"),
    "OperationalToHaltedAuto": ("Operational", "Halted"),
    "OperationalToErrorAuto": ("Operational", "Error"),
}
AUTOMATIC_TRANSITIONS: dict[str, tuple[str, str]] = {
    "InitializedToReadyRecipe": ("Initialized", "Ready"),
    "InitializedToReadyProduct": ("Initialized", "Ready"),
    "InitializedToReadyAuto": ("Initialized", "Ready"),
    "ReadyToInitializedRecipe": ("Ready", "Initialized"),
    "ReadyToInitializedProduct": ("Ready", "Initialized"),
    "ReadyToInitializedAuto": ("Ready", "Initialized"),
    "ReadyToSingleExecution": ("Ready", "SingleExecution"),
    "ReadyToSingleExecutionAuto": ("Ready", "SingleExecution"),
    "ReadyToContinuousExecution": ("Ready", "ContinuousExecution"),
    "ReadyToContinuousExecutionAuto": ("Ready", "ContinuousExecution"),
    "SingleExecutionToReadyStop": ("SingleExecution", "Ready"),
    "SingleExecutionToReadyAbort": ("SingleExecution", "Ready"),
    "SingleExecutionToReadyAuto": ("SingleExecution", "Ready"),
    "ContinuousExecutionToReadyStop": ("ContinuousExecution", "Ready"),
    "ContinuousExecutionToReadyAbort": ("ContinuousExecution", "Ready"),
    "ContinuousExecutionToReadyAuto": ("ContinuousExecution", "Ready"),
}


class WrongStateError(Exception):
    """The transition does not begin in the state that the machine is in."""


class VisionMachine:
    """Both machines; ``changed`` hears of every transition: its name, the state it left, the state
    it led to."""

    def __init__(self, changed: Callable[[str, str, str], None] | None = None) -> None:
        self.state = "Preoperational"
        self.automatic = ""
        """State of automatic mode; empty outside of Operational."""
        self._changed = changed or (lambda *_: None)

    def fire(self, transition: str) -> None:
        """Take a transition. Raises WrongStateError, and then nothing has changed; KeyError for an
        unknown one."""
        if transition in AUTOMATIC_TRANSITIONS:
            source, target = AUTOMATIC_TRANSITIONS[transition]
            self._check(transition, self.automatic, source)
            self.automatic = target
        else:
            source, target = TRANSITIONS[transition]
            self._check(transition, self.state, source)
            self.state = target
            self.automatic = "Initialized" if target == "Operational" else ""
        self._changed(transition, source, target)

    @property
    def executing(self) -> bool:
        return self.automatic in ("SingleExecution", "ContinuousExecution")

    def _check(self, transition: str, now: str, source: str) -> None:
        if now != source:
            raise WrongStateError(
                f"{transition} begins in {source}, the system is in {now or self.state}"
            )
