"""What a plan has to keep to, and which of it an action keeps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from models.manipulation.actions import Candidates
from models.manipulation.fixtures import segment_distance
from models.manipulation.frames import FloatArray, IntArray
from models.manipulation.scaling import MOVE_SCALE


@dataclass(frozen=True, eq=False)
class Limits:
    """``box`` (2, 2) m, lowest and highest x, y that the DLO and the gripper may reach; ``zones``
    polygons (k, 2) m that neither may enter; ``base`` (2,) m and ``reach`` (2,) m, least and
    largest distance of a pick or a place to it; ``gripper`` m, radius of the room that a gripper
    takes, which no zone may enter; ``shift`` m and ``turn`` rad the largest of an action;
    ``no_grasp`` edges that must not be gripped. None: no such limit."""

    box: FloatArray | None = None
    zones: Sequence[FloatArray] = ()
    base: FloatArray | None = None
    reach: tuple[float, float] = (0.0, float("inf"))
    shift: float = float(MOVE_SCALE[0])
    turn: float = float(MOVE_SCALE[2])
    no_grasp: Sequence[int] = ()
    gripper: float = 0.0

    @property
    def largest(self) -> FloatArray:
        """(3,) bounds for the optimizer; never beyond what the network was trained on."""
        return np.minimum([self.shift, self.shift, self.turn], MOVE_SCALE)

    def edges(self, nodes: int) -> IntArray:
        """Those that may be gripped."""
        return np.setdiff1d(np.arange(nodes - 1), np.asarray(self.no_grasp, np.int64))


@dataclass(frozen=True)
class Check:
    """One limit, and whether an action keeps it."""

    name: str
    passed: bool


def checks(state: FloatArray, candidates: Candidates, k: int, limits: Limits) -> list[Check]:
    """What candidate ``k`` keeps of the limits, those that were set and the displacement that
    always is."""
    edge, move, after = int(candidates.edge[k]), candidates.move[k], candidates.predicted[k]
    pick = state[edge : edge + 2].mean(0)
    place = pick + move[:2]
    travelled = float(np.hypot(move[0], move[1]))
    found = [
        Check("displacement", travelled <= limits.shift * np.sqrt(2) + 1e-9),
        Check("rotation", abs(float(move[2])) <= limits.turn + 1e-9),
    ]
    if limits.box is not None:
        low, high = limits.box
        points = np.vstack([pick, place, after])
        found.append(Check("workspace", bool(np.all((points >= low) & (points <= high)))))
    if limits.base is not None:
        away = np.hypot(*(np.stack([pick, place]) - limits.base).T)
        found.append(
            Check("reach", bool(np.all((away >= limits.reach[0]) & (away <= limits.reach[1]))))
        )
    if limits.zones:
        met = any(
            carried_into(pick, place, limits.gripper, z) or inside(dense(after), z).any()
            for z in limits.zones
        )
        found.append(Check("keep_out", not met))
    if limits.no_grasp:
        found.append(Check("grasp", edge not in limits.no_grasp))
    return found


def carried_into(pick: FloatArray, place: FloatArray, radius: float, zone: FloatArray) -> bool:
    """Whether a circle (``radius`` m) that goes straight from ``pick`` to ``place`` (2,) meets a
    polygon (k, 2)."""
    if inside(np.stack([pick, place]), zone).any():
        return True
    away = segment_distance(pick[None], place[None], zone, np.roll(zone, -1, 0))
    return bool((away <= radius).any())


def dense(points: FloatArray, parts: int = 4) -> FloatArray:
    """The polyline's points and ``parts`` - 1 between every two."""
    share = np.arange(parts)[None, :, None] / parts
    between = points[:-1, None] * (1 - share) + points[1:, None] * share
    return np.vstack([between.reshape(-1, 2), points[-1:]])


def inside(points: FloatArray, polygon: FloatArray) -> np.ndarray:
    """(m,) whether points (m, 2) lie in the polygon (k, 2), by counting crossings of a ray."""
    a, b = polygon, np.roll(polygon, -1, 0)
    x, y = points[:, :1], points[:, 1:]
    straddles = (a[:, 1] > y) != (b[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = a[:, 0] + (y - a[:, 1]) / (b[:, 1] - a[:, 1]) * (b[:, 0] - a[:, 0])
    return np.asarray((straddles & (x < at)).sum(1) % 2 == 1)
