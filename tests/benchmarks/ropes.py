"""Ropes to try the planner on: the thesis's three, in the own simulator and in one that no network
has seen."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from models.manipulation.simulator import Actions, Ropes, SimulationParams, simulate, straight

NODES = 16


@dataclass(frozen=True)
class RopeKind:
    """Length m, mass kg, diameter m (thesis 5.7), and what the planner is not told: k_b, and k_d on
    two surfaces for the own simulator; bending stiffness and friction for the other."""

    name: str
    length: float
    mass: float
    diameter: float
    bending: float
    stiffness: float


# Mass, length and diameter of black and red as in the thesis; white's k_b is its estimate there.
# Stiffness N m^2.
ROPES = (
    RopeKind("white", 0.46, 0.04, 0.010, 0.08, 6e-5),
    RopeKind("black", 0.42, 0.05, 0.014, 0.40, 2e-4),
    RopeKind("red", 0.50, 0.02, 0.005, 0.15, 3e-5),
)
SURFACES = {"cloth": (22.0, 0.9), "cardboard": (8.0, 0.4)}
"""k_d for the own simulator; coefficient of friction for the other."""


HARD_TARGETS: dict[str, Callable[[float], float]] = {
    "deep S": lambda t: 1.6 * math.cos(2 * math.pi * t),
    "M": lambda t: 1.1 * math.cos(3 * math.pi * t),
    "loop": lambda t: 2.3 * (2 * t - 1),
}
"""Heading over the share of the length, of shapes that no single grasp leads towards."""


def hard_shape(name: str, length: float) -> np.ndarray:
    """(n, 2) m, about its middle."""
    headings = np.array([HARD_TARGETS[name]((k + 0.5) / (NODES - 1)) for k in range(NODES - 1)])
    edges = length / (NODES - 1) * np.column_stack([np.cos(headings), np.sin(headings)])
    points = np.vstack([np.zeros((1, 2)), np.cumsum(edges, 0)])
    return np.asarray(points - points.mean(0))


class Table(Protocol):
    """A rope on a table: ``state`` (n, 2) m, and an action carried out."""

    def state(self) -> np.ndarray: ...

    def act(self, edge: int, move: np.ndarray) -> None: ...


class OwnTable:
    """The analytical model that the network learnt from, with hidden parameters."""

    def __init__(self, kind: RopeKind, surface: str) -> None:
        self._rope = Ropes.same(1, kind.mass, kind.bending, SURFACES[surface][0], kind.length)
        self._state = straight(self._rope.length, NODES)

    def state(self) -> np.ndarray:
        return self._state[0]

    def act(self, edge: int, move: np.ndarray) -> None:
        action = Actions(np.array([edge]), move[None, :2], move[2:])
        self._state = simulate(self._state, action, self._rope, SimulationParams(steps=80))


class MujocoTable:
    """A chain of capsules with bending springs on a plane with friction, moved at 0.1 m/s and then
    left alone."""

    def __init__(
        self,
        kind: RopeKind,
        surface: str,
        stiffer: float = 1.0,
        nodes: int = NODES,
        fixtures: str = "",
    ) -> None:
        """``fixtures``: geoms that stand on the table."""
        import mujoco

        self._mj = mujoco
        self._nodes = nodes
        self._model = mujoco.MjModel.from_xml_string(
            _xml(kind, SURFACES[surface][1], stiffer, nodes, fixtures)
        )
        self._data = mujoco.MjData(self._model)
        self._edge_length = kind.length / (nodes - 1)
        mujoco.mj_forward(self._model, self._data)
        self._run(0.3)

    def state(self) -> np.ndarray:
        bodies = [self._data.body(f"b{k}") for k in range(self._nodes - 1)]
        points = [b.xpos[:2].copy() for b in bodies]
        last = bodies[-1]
        points.append(last.xpos[:2] + self._edge_length * last.xmat.reshape(3, 3)[:2, 0])
        return np.array(points)

    def put(self, points: np.ndarray) -> None:
        """Lay the rope down in a shape (n, 2) and let go."""
        headings = np.unwrap(np.arctan2(*np.diff(points, axis=0).T[::-1]))
        place = self._data.qpos
        place[:2], place[3:7] = points[0], [np.cos(headings[0] / 2), 0, 0, np.sin(headings[0] / 2)]
        place[7:] = np.diff(headings)
        self._data.qvel[:] = 0
        self._mj.mj_forward(self._model, self._data)
        self._run(0.5)

    def stand(self, name: str, there: bool) -> None:
        """Whether the rope meets the geoms whose names begin with ``name`` from now on.

        They are made solid: MuJoCo never looks again at geoms that are not so when the model is
        compiled.
        """
        for k in range(self._model.ngeom):
            if self._model.geom(k).name.startswith(name):
                self._model.geom_contype[k] = self._model.geom_conaffinity[k] = int(there)

    def act(self, edge: int, move: np.ndarray, arrived: Callable[[], None] = lambda: None) -> None:
        """The edge is welded to a mocap body, lifted by nothing, dragged and turned, let go after
        ``arrived``."""
        body = self._data.body(f"b{edge}")
        start, heading = body.xpos.copy(), np.arctan2(body.xmat[3], body.xmat[0])
        middle = start[:2] + self._edge_length / 2 * np.array([np.cos(heading), np.sin(heading)])
        self._place(start, heading)
        self._hold(edge, True)
        duration = max(0.3, float(np.hypot(*move[:2])) / 0.1)
        for share in np.linspace(0, 1, int(duration / 0.01))[1:]:
            angle = heading + share * move[2]
            direction = np.array([np.cos(angle), np.sin(angle)])
            xy = middle + share * move[:2] - self._edge_length / 2 * direction
            self._place(np.array([*xy, start[2]]), angle)
            self._run(0.01)
        arrived()
        self._hold(edge, False)
        self._run(0.5)

    def _hold(self, edge: int, on: bool) -> None:
        self._data.eq_active[self._model.equality(f"grip{edge}").id] = on

    def _place(self, xyz: np.ndarray, angle: float) -> None:
        self._data.mocap_pos[0] = xyz
        self._data.mocap_quat[0] = [np.cos(angle / 2), 0, 0, np.sin(angle / 2)]

    def _run(self, seconds: float) -> None:
        for _ in range(round(seconds / self._model.opt.timestep)):
            self._mj.mj_step(self._model, self._data)


class FilmedTable(MujocoTable):
    """Keeps the rope after every small step of the gripper."""

    def __init__(self, kind: RopeKind, surface: str, nodes: int = NODES) -> None:
        self.frames: list[np.ndarray] = []
        super().__init__(kind, surface, nodes=nodes)

    def _run(self, seconds: float) -> None:
        super()._run(seconds)
        self.frames.append(self.state())


def _xml(kind: RopeKind, friction: float, stiffer: float, nodes: int, fixtures: str) -> str:
    edge, radius = kind.length / (nodes - 1), kind.diameter / 2
    spring, mass = stiffer * kind.stiffness / edge, kind.mass / (nodes - 1)
    inner = ""
    for k in reversed(range(nodes - 1)):
        joint = (
            "<freejoint/>"
            if k == 0
            else f'<joint type="hinge" axis="0 0 1" stiffness="{spring}" damping="{spring * 0.02}"/>'
        )
        place = f"{-kind.length / 2} 0 {radius}" if k == 0 else f"{edge} 0 0"
        inner = (
            f'<body name="b{k}" pos="{place}">{joint}<geom type="capsule" fromto="0 0 0 {edge} 0 0" '
            f'size="{radius}" mass="{mass}" friction="{friction} 0.005 0.0001"/>{inner}</body>'
        )
    welds = "".join(
        f'<weld name="grip{k}" body1="hand" body2="b{k}" active="false" relpose="0 0 0 1 0 0 0" solref="0.01 1"/>'
        for k in range(nodes - 1)
    )
    exclude = "".join(f'<exclude body1="b{k}" body2="b{k + 1}"/>' for k in range(nodes - 2))
    return (
        '<mujoco><option timestep="0.002" integrator="implicitfast"/><worldbody>'
        f'<geom type="plane" size="2 2 0.1" friction="{friction} 0.005 0.0001"/>'
        f'{fixtures}<body name="hand" mocap="true"/>{inner}</worldbody><equality>{welds}</equality>'
        f"<contact>{exclude}</contact></mujoco>"
    )
