"""Which cable is on top, gathered over the frames: one doubtful picture does not turn a crossing
over."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from models.instances.scene import Crossing, Scene, StrandPosition
from models.tracking.state import NODES, CrossingOrder, TrackedCable

_MEMORY = 0.9
"""Share of the evidence of earlier frames that still counts in the next one."""
_SAME_PLACE = 0.12
"""Crossings of the same two cables nearer than this share of their lengths are one."""
_MOST_EVIDENCE = 8.0


class Place(NamedTuple):
    """The part from ``u0`` to ``u1`` of an observation is on ``cable``, from ``first`` to ``last``
    of its length."""

    u0: float
    u1: float
    cable: int
    first: float
    last: float


Places = dict[int, list[Place]]
"""By the observation's number."""


def carried_on(
    before: Sequence[CrossingOrder], scene: Scene, cables: Sequence[TrackedCable], places: Places
) -> tuple[CrossingOrder, ...]:
    """The crossings of this frame with the evidence of earlier ones, and those that are out of
    view, faded."""
    known = {cable.id: cable for cable in cables}
    left = list(before)
    orders: list[CrossingOrder] = []
    for crossing in scene.crossings:
        seen = _seen(crossing, places)
        if seen is None:
            continue
        earlier = next((order for order in left if _same(order, seen)), None)
        if earlier is not None:
            left.remove(earlier)
            seen = _combined(earlier, seen)
        orders.append(seen)
    hidden = [order for order in left if _out_of_view(order, known)]
    return (*orders, *(order._replace(evidence=_MEMORY * order.evidence) for order in hidden))


def _seen(crossing: Crossing, places: Places) -> CrossingOrder | None:
    over, under = _place(crossing.over, places), _place(crossing.under, places)
    if over is None or under is None:
        return None
    share = float(np.clip(crossing.score, 0.5, 0.999))
    return CrossingOrder(
        over[0], under[0], over[1], under[1], crossing.xy, float(np.log(share / (1 - share)))
    )


def _place(position: StrandPosition, places: Places) -> tuple[int, float] | None:
    near = [
        place
        for place in places.get(position.instance, [])
        if place.u0 - 1e-6 <= position.u <= place.u1 + 1e-6
    ]
    if not near:
        return None
    place = near[0]
    share = (position.u - place.u0) / max(place.u1 - place.u0, 1e-9)
    return place.cable, float(np.clip(place.first + share * (place.last - place.first), 0.0, 1.0))


def _same(a: CrossingOrder, b: CrossingOrder) -> bool:
    straight = (
        (a.over, a.under) == (b.over, b.under)
        and _near(a.over_u, b.over_u)
        and _near(a.under_u, b.under_u)
    )
    turned = (
        (a.over, a.under) == (b.under, b.over)
        and _near(a.over_u, b.under_u)
        and _near(a.under_u, b.over_u)
    )
    return straight or turned


def _near(a: float, b: float) -> bool:
    return abs(a - b) < _SAME_PLACE


def _combined(earlier: CrossingOrder, seen: CrossingOrder) -> CrossingOrder:
    agrees = earlier.over == seen.over and (
        earlier.over != earlier.under or _near(earlier.over_u, seen.over_u)
    )
    evidence = seen.evidence + (_MEMORY if agrees else -_MEMORY) * earlier.evidence
    if evidence < 0:
        seen = seen._replace(
            over=seen.under, under=seen.over, over_u=seen.under_u, under_u=seen.over_u
        )
    return seen._replace(evidence=min(abs(evidence), _MOST_EVIDENCE))


def _out_of_view(order: CrossingOrder, cables: Mapping[int, TrackedCable]) -> bool:
    """Whether the place of the crossing is covered on either cable: then nothing speaks against
    it."""
    ends = ((order.over, order.over_u), (order.under, order.under_u))
    return all(cable in cables for cable, _ in ends) and any(
        not cables[cable].seen[round(u * (NODES - 1))] for cable, u in ends
    )
