"""Tables with pegs, clips and edges in MuJoCo, and what a rope has to do on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.manipulation.fixtures import Clip, Fixtures
from models.manipulation.limits import dense
from models.manipulation.routes import Impossible, Route, Stop
from models.manipulation.routing import FINE
from tests.benchmarks.ropes import ROPES, SURFACES, MujocoTable, RopeKind

SLACK_M = 0.02
_TALL_M = 0.03
_CLIP_M, _PLAY_M = 0.02, 0.0025
"""Length of a clip, and what a rope in it may be off to either side."""
_PRESSED_M = 0.003
"""Farther off than the walls allow, a rope is still pressed in."""
_WALL_M = 0.002
_ROOM_M = 0.03
"""That a rope and a gripper need between two fixtures."""


@dataclass(frozen=True, eq=False)
class Scene:
    """``sides`` (1 left, -1 right) of the ``pegs`` (P, 2) of ``radius`` m; ``clips`` (x, y, angle);
    ``walls`` segments (2, 2); ``order`` of the stops as (kind, index); the rope lies from
    ``start`` straight at ``angle`` rad to x."""

    kind: RopeKind
    surface: str
    pegs: np.ndarray
    sides: list[int]
    clips: np.ndarray
    walls: np.ndarray
    order: list[tuple[str, int]]
    start: np.ndarray
    angle: float
    radius: float = 0.012

    @property
    def half(self) -> float:
        return self.kind.diameter / 2

    def clip(self, k: int) -> Clip:
        x, y, angle = self.clips[k]
        return Clip(np.array([x, y]), float(angle), _PLAY_M, _CLIP_M)

    def fixtures(self) -> Fixtures:
        radii = [self.radius + self.half] * len(self.pegs) + [_WALL_M + self.half] * len(self.walls)
        starts = np.concatenate([self.pegs, self.walls[:, 0]])
        ends = np.concatenate([self.pegs, self.walls[:, 1]])
        return Fixtures(
            starts, ends, np.array(radii), [self.clip(k) for k in range(len(self.clips))]
        )

    def route(self) -> Route:
        stops = [
            Stop(self.pegs[k], self.radius + self.half, self.sides[k])
            if what == "peg"
            else Stop(self.clips[k, :2], clip=self.clip(k))
            for what, k in self.order
        ]
        return Route(stops, SLACK_M, self.start)

    def straight(self) -> np.ndarray:
        """(31, 2) the rope as it is at first."""
        direction = np.array([np.cos(self.angle), np.sin(self.angle)])
        return self.start + np.linspace(0, self.kind.length, FINE)[:, None] * direction


class FixtureTable:
    """The scene in MuJoCo. The walls of a clip stand from when a gripper first lets go of a rope
    between them."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._table = MujocoTable(scene.kind, scene.surface, nodes=FINE, fixtures=_geoms(scene))
        self._table.stand("clip", False)
        self._table.put(scene.straight())

    def state(self) -> np.ndarray:
        return self._table.state()

    def act(self, edge: int, move: np.ndarray) -> None:
        self._table.act(edge, move, self._pressed)

    def _pressed(self) -> None:
        shape = self._table.state()
        for k in range(len(self._scene.clips)):
            if between(self._scene, k, shape, _PRESSED_M):
                self._table.stand(f"clip{k}", True)


def between(scene: Scene, k: int, shape: np.ndarray, off_m: float = 1e-3) -> bool:
    """Whether a rope (n, 2) is between the walls of a clip, or no more than ``off_m`` outside."""
    x, y, angle = scene.clips[k]
    along = np.array([np.cos(angle), np.sin(angle)])
    local = (dense(shape, 8) - [x, y]) @ np.column_stack([along, [-along[1], along[0]]])
    near = local[np.hypot(*local.T) < 2 * _CLIP_M]
    inside = near[np.abs(near[:, 0]) <= _CLIP_M / 2]
    through = len(near) and near[:, 0].min() < -_CLIP_M / 2 and near[:, 0].max() > _CLIP_M / 2
    return bool(through and len(inside) and np.abs(inside[:, 1]).max() <= _PLAY_M + off_m)


def solved(scene: Scene, shape: np.ndarray) -> bool:
    """Whether a rope (n, 2) goes by all stops in order, every peg on its side within the slack,
    every clip filled."""
    line = dense(shape, 8)
    ahead = np.gradient(line, axis=0)
    last = 0
    for what, k in scene.order:
        place = scene.pegs[k] if what == "peg" else scene.clips[k, :2]
        away = place - line
        at = int(np.argmin(np.hypot(*away.T)))
        if at <= last or at >= len(line) - 2:
            return False
        last = at
        if what == "clip" and not between(scene, k, shape):
            return False
        if what == "peg":
            side = np.sign(ahead[at, 0] * away[at, 1] - ahead[at, 1] * away[at, 0])
            if side != scene.sides[k] or np.hypot(*away[at]) > scene.radius + scene.half + SLACK_M:
                return False
    return True


def scenes(what: str, count: int, seed: int) -> list[Scene]:
    """``what``: "pegs" (two or three), "clips" (two or three) or "mixed" (a peg, a clip and a
    wall)."""
    rng = np.random.default_rng(seed)
    found: list[Scene] = []
    while len(found) < count:
        kind = ROPES[len(found) % len(ROPES)]
        surface = list(SURFACES)[len(found) // len(ROPES) % len(SURFACES)]
        scene = _random(rng, what, kind, surface)
        if _possible(scene):
            found.append(scene)
    return found


def _random(rng: np.random.Generator, what: str, kind: RopeKind, surface: str) -> Scene:
    many = int(rng.integers(2, 4)) if what != "mixed" else 2
    x = np.sort(rng.uniform(0.08, 0.75 * kind.length, many))
    places = np.column_stack([x, rng.uniform(-0.06, 0.06, many)])
    kinds = {"pegs": ["peg"] * many, "clips": ["clip"] * many, "mixed": ["peg", "clip"]}[what]
    if what == "mixed" and rng.random() < 0.5:
        kinds.reverse()
    pegs = places[[k for k, name in enumerate(kinds) if name == "peg"]].reshape(-1, 2)
    held = places[[k for k, name in enumerate(kinds) if name == "clip"]].reshape(-1, 2)
    clips = np.column_stack([held, rng.uniform(-0.7, 0.7, len(held))])
    walls = np.zeros((0, 2, 2))
    if what == "mixed":
        middle, angle = rng.uniform([0.1, -0.1], [0.4, 0.1]), rng.uniform(0, np.pi)
        reach = 0.025 * np.array([np.cos(angle), np.sin(angle)])
        walls = np.array([[middle - reach, middle + reach]])
    counted = {"peg": 0, "clip": 0}
    order = []
    for name in kinds:
        order.append((name, counted[name]))
        counted[name] += 1
    start = np.array([0.0, rng.uniform(-0.08, 0.08)])
    sides, angle = rng.choice([-1, 1], len(pegs)).tolist(), float(rng.uniform(-1.6, 1.6))
    return Scene(kind, surface, pegs, sides, clips, walls, order, start, angle)


def _possible(scene: Scene) -> bool:
    """Whether a rope can lie on the route, touches nothing at first, and fixtures leave room
    between them."""
    fixtures, straight = scene.fixtures(), scene.straight()
    places = np.concatenate([scene.pegs, scene.clips[:, :2], scene.walls.mean(1)])
    gaps = np.hypot(*np.moveaxis(places[:, None] - places, -1, 0))[np.triu_indices(len(places), 1)]
    if (
        gaps.min(initial=1.0) < 2 * scene.radius + _ROOM_M
        or fixtures.gap(straight[:-1], straight[1:]).min(initial=1.0) < 0.003
    ):
        return False
    try:
        shape = scene.route().shape(scene.kind.length, FINE)
    except Impossible:
        return False
    turned = np.abs(np.diff(np.unwrap(np.arctan2(*np.diff(shape, axis=0).T[::-1]))))
    apart = fixtures.gap(shape[:-1], shape[1:]).min(initial=1.0)
    # A rope of this stiffness does not bend sharper than with a radius of some 2 cm.
    return bool(apart > 0.001 and turned.max() < 0.9 and solved(scene, shape)) and not solved(
        scene, straight
    )


def peg_geom(x: float, y: float, radius: float) -> str:
    """For MuJoCo; lengths in m."""
    half = _TALL_M / 2
    return f'<geom type="cylinder" pos="{x} {y} {half}" size="{radius} {half}" friction="0.2 0 0"/>'


def _geoms(scene: Scene) -> str:
    parts = [peg_geom(x, y, scene.radius) for x, y in scene.pegs]
    parts += [_wall("", *wall) for wall in scene.walls]
    for k, (x, y, angle) in enumerate(scene.clips):
        along = np.array([np.cos(angle), np.sin(angle)])
        side = (_PLAY_M + scene.half + _WALL_M) * np.array([-along[1], along[0]])
        for sign in (-1, 1):
            middle = np.array([x, y]) + sign * side
            ends = middle - _CLIP_M / 2 * along, middle + _CLIP_M / 2 * along
            parts.append(_wall(f'name="clip{k}{"ab"[sign > 0]}" ', *ends))
    return "".join(parts)


def _wall(name: str, a: np.ndarray, b: np.ndarray) -> str:
    middle, half = (a + b) / 2, float(np.hypot(*(b - a))) / 2
    angle = np.degrees(np.arctan2(*(b - a)[::-1]))
    return (
        f'<geom {name}type="box" pos="{middle[0]} {middle[1]} {_TALL_M / 2}" euler="0 0 {angle}" '
        f'size="{half} {_WALL_M} {_TALL_M / 2}" friction="0.2 0 0"/>'
    )
