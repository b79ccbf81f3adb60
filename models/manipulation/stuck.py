"""Why a DLO comes no nearer to its target."""

from __future__ import annotations

from typing import Literal

from models.manipulation.belief import Belief
from models.manipulation.frames import FloatArray
from models.manipulation.limits import Limits

Reason = Literal["springs_back", "unlike_any_model", "limits", "local_optimum"]
FRUITLESS = 4
"""Actions in a row without a new least distance after which more of them are not worth the time.
Fewer would end detours: where one action brings little, the plan is that the second brings more."""
_PROGRESS = 0.95
"""Share of the least distance so far that counts as a new one."""
_UNEXPLAINED, _ITEMS = 0.6, 3
"""Share of the motion that no model explains, and actions seen, from which a DLO is like none that
is known."""


def no_progress(errors: FloatArray) -> bool:
    """Whether the last few of M actions brought nothing; ``errors`` (M, 2) distances to the target
    before and after each."""
    if len(errors) < FRUITLESS:
        return False
    earlier = min(
        float(errors[:-FRUITLESS].min(initial=float("inf"))), float(errors[-FRUITLESS, 0])
    )
    return float(errors[-FRUITLESS:, 1].min()) > _PROGRESS * earlier


def unlike_any_model(belief: Belief) -> bool:
    """Whether the DLO moves as none of the models has it."""
    return len(belief.history.edge) >= _ITEMS and belief.unexplained > _UNEXPLAINED


def reason_of(
    belief: Belief, target: FloatArray, limits: Limits, tolerance: float
) -> tuple[Reason, str]:
    """The most probable reason, for programs and in words; ``tolerance`` m of the mean distance to
    the target."""
    back = belief.springs_back_m(target)
    if back > tolerance:
        return "springs_back", "friction does not hold the DLO in the target's shape"
    if unlike_any_model(belief):
        return "unlike_any_model", "the DLO does not move as any known model"
    if _bound(limits):
        return "limits", "with the given limits no other action helps"
    return "local_optimum", "no sequence that was looked at leads out of this shape"


def _bound(limits: Limits) -> bool:
    """Whether anything but the trained range binds."""
    free = Limits()
    set_ = (
        limits.box is not None
        or limits.base is not None
        or bool(limits.zones)
        or bool(limits.no_grasp)
    )
    return set_ or limits.shift < free.shift or limits.turn < free.turn
