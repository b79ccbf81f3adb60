"""The dual-arm move that removes a crossing (thesis Algorithm 7, section 6.7), simulated before it
is proposed.

Strategy: one arm holds a place of the harness, the other takes the piece beyond it and turns it
about that place. A small network, which has seen many turns work and fail in a simulated world,
gives how likely each turn is to do what the simulation foresees; that, how many crossings go at
once and how much of the piece stays in view make the ranking. All lengths are in hands, so the
picture's resolution changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np

from models.disentangling.expectations import Attempt, updated
from models.disentangling.hands import Frame, in_hands, usual_hand_px
from models.disentangling.hold_candidates import MOST_HOLDS, find_holds
from models.disentangling.result_of_turn import after_turn
from models.disentangling.rigid_piece import Pivot, as_pair, turned
from models.disentangling.supposed_touches import loosened
from models.disentangling.sweep import Sweep
from models.disentangling.turn_candidates import Turn, find_turns
from models.geometry.arrays import FloatArray
from models.geometry.polylines import arc_lengths, point_at
from models.topology.classifiers import Classifier, probabilities_of
from models.topology.scene import Topology


@dataclass(frozen=True)
class DisentangleParams:
    """``hand_px``: what the gripper needs beside the strand that it closes on, None for what a
    typical strand of the topology takes; ``clearance_widths``: wished distance to other sections
    after the move; ``margin_px``: how far outside the picture the piece may end; ``at_most``:
    actions proposed; ``attempts``: turns done so far, in px."""

    hand_px: float | None = None
    clearance_widths: float = 1.0
    margin_px: float = 0.0
    at_most: int = 5
    attempts: Sequence[Attempt] = field(default_factory=tuple)


@dataclass(frozen=True, eq=False)
class Grasp:
    """``angle``: radians, along the section; the gripper closes across it."""

    xy: tuple[float, float]
    angle: float

    def scaled(self, factor: float) -> Grasp:
        return replace(self, xy=(factor * self.xy[0], factor * self.xy[1]))


@dataclass(frozen=True, eq=False)
class Action:
    """``crossing`` and ``section``: indices; ``turn`` radians about ``hold``; ``trajectory``: ``(n,
    2)`` arc from ``pick`` to ``place``; ``after``: crossings that the simulation counts then, of
    ``before``; ``passed``: sections that the piece is lifted over; ``certainty``: probability that
    it is on top wherever it crosses something; ``score``: probability that it does so and leaves
    the place easy to read, learned in a simulated world; ``touching``: the branch-point that is
    supposed to be a mere touch, or -1."""

    crossing: int
    section: int
    branch: int
    hold: Grasp
    pick: Grasp
    place: Grasp
    trajectory: FloatArray
    turn: float
    before: int
    after: int
    passed: tuple[int, ...]
    clearance: float
    certainty: float
    score: float
    leaves_view: bool
    touching: int

    def scaled(self, factor: float) -> Action:
        """The same action with all lengths in another unit."""
        return replace(
            self,
            hold=self.hold.scaled(factor),
            pick=self.pick.scaled(factor),
            place=self.place.scaled(factor),
            trajectory=factor * self.trajectory,
            clearance=factor * self.clearance,
        )


_MOST_HOLDS_AHEAD = 40
"""Places to hold that are looked at one move ahead."""
_MOST_HOLDS_IN_ALL = 1000
"""Places to hold that one plan looks at, however many crossings and rings there are."""
_MOST_AHEAD = 5
"""Options of which the state that they leave is looked at: each takes as long as planning once."""
_LIKELY = 0.4
"""Where no turn has a better chance, preparing ones are looked at too."""
_STUCK = 0.02
"""Chance of going on where no turn is found, not even a preparing one."""
_PREPARING = 0.7
"""What a turn that only prepares another one is worth beside one that leads on, as one such turn
must not follow another for ever."""
_OUT_OF_VIEW = 2
"""Where crossings are left, a piece of which a tenth leaves the view is worth a fifth less: they
have to be seen again. After the last one it is worth a tenth less."""
_TOUCHES = 0.2
"""How often a joint that closes a ring turns out to be a mere touch."""
_MOST_SUPPOSED = 6
"""Joints that are supposed, one at a time, to be mere touches."""
_EQUAL = 0.02
"""Chances that differ by less are equal: the network is not that exact."""
_INSIDE, _HEADING = 1 / 6, 1 / 3
"""Hands from a section's end within which its direction is not read, and on either side over which
it is."""
_ARC_POINTS = 25
"""Of a trajectory: a chord of the longest turn, 175 degrees, leaves the arc by 0.2 % of its
radius."""
UNSURE_BELOW = 0.3
"""Below this probability an action more likely fails than works, even where the network is a little
off."""


def plan(
    topology: Topology, classifier: Classifier, params: DisentangleParams | None = None
) -> list[Action]:
    """The best of :func:`proposed`, at most ``params.at_most``."""
    settings = params or DisentangleParams()
    return list(islice(proposed(topology, classifier, settings), settings.at_most))


def proposed(
    topology: Topology, classifier: Classifier, settings: DisentangleParams
) -> Iterator[Action]:
    """Actions that leave fewer crossings than there are, or as many where only a preparing one is
    likely to lead on; best first, one for every place to hold, however many are ``at_most`` wanted.

    Where everything is held at both ends, actions follow that suppose one branch-point to be a mere
    touch. ``classifier``: of :data:`evidence.MOVE_FEATURES`, the probability that a turn works.
    """
    hand_px = settings.hand_px or usual_hand_px(topology)
    frame = Frame.of(topology, hand_px, settings.margin_px)
    scene = in_hands(topology, hand_px)
    attempts = [a.scaled(1 / hand_px) for a in settings.attempts]
    search = Search(classifier, frame, settings.clearance_widths, attempts)
    options = search.ranked(scene)
    if scene.crossings and all(o.turn.after >= len(scene.crossings) for o in options):
        options += [
            replace(o, score=_TOUCHES * o.score, chance=_TOUCHES * o.chance, touching=branch)
            for branch, loose in loosened(scene, _MOST_SUPPOSED)
            for o in search.ranked(loose)
        ]
    for option in _preferred(options):
        yield action_of(scene, option.turn, option.score, option.touching).scaled(hand_px)


def _preferred(options: list[Option]) -> list[Option]:
    """One option for every place to hold, best first. Of equally good ones the smaller turn, and
    for the first action a branch-point, which the thesis holds (6.7): noise in widths must not
    change the action."""
    places: dict[Pivot, list[Option]] = {}
    for option in options:
        places.setdefault(option.turn.held.pivot, []).append(option)
    chosen = [min(_best(found), key=lambda o: abs(o.turn.angle)) for found in places.values()]
    first = sorted(_best(chosen), key=lambda o: (o.turn.held.pivot.branch < 0, abs(o.turn.angle)))
    others = [o for o in chosen if all(o is not f for f in first)]
    return first + sorted(others, key=lambda o: -o.chance)


def _best(options: list[Option]) -> list[Option]:
    """Those whose chance is as good as equal to the highest one."""
    highest = max((o.chance for o in options), default=0.0)
    return [o for o in options if o.chance >= highest - _EQUAL * min(1.0, highest / _LIKELY)]


@dataclass(frozen=True, eq=False)
class Option:
    """A turn, the probability that it works, and the chance that all crossings go if it is
    chosen."""

    turn: Turn
    score: float
    chance: float
    touching: int = -1


@dataclass(eq=False)
class Looks:
    """How many places to hold may still be looked at."""

    left: int

    def taken(self, most: int) -> int:
        return max(0, min(most, self.left))


@dataclass(frozen=True, eq=False)
class Search:
    """Options for a scene in hands: how turns are weighed, where a piece may end, how much room is
    wished, what was tried, and how many places may still be looked at."""

    classifier: Classifier
    frame: Frame
    clearance_widths: float = DisentangleParams.clearance_widths
    attempts: Sequence[Attempt] = ()
    looks: Looks = field(default_factory=lambda: Looks(_MOST_HOLDS_IN_ALL))

    def ranked(self, scene: Topology) -> list[Option]:
        """Strategy: rank by the chance that all crossings go; of the best options that part
        different crossings, look at what they leave; where none is likely, look at turns too that
        only prepare another one."""
        looked: dict[object, Option] = {}
        options: list[Option] = []
        for gain in (1, 0):
            options = self.options(scene, gain, MOST_HOLDS)
            if gain and max((o.chance for o in options), default=0.0) < _LIKELY:
                continue
            different: dict[object, Option] = {}
            for option in options:
                different.setdefault(_kind(option), option)
            new = [(kind, o) for kind, o in different.items() if kind not in looked]
            looked |= {kind: self.with_what_follows(scene, o) for kind, o in new[:_MOST_AHEAD]}
            if max((o.chance for o in looked.values()), default=0.0) >= _LIKELY:
                break
        return [_in_light_of(o, looked) for o in options]

    def options(self, scene: Topology, gain: int, most_holds: int) -> list[Option]:
        """The best first: as if each crossing that is left took a move as likely to work as this
        one, and a preparing turn one move more; less if the piece leaves the view, as nobody knows
        then what it is on."""
        holds = find_holds(scene, self.looks.taken(most_holds))
        self.looks.left -= len(holds)
        turns = find_turns(scene, holds, self.frame, self.clearance_widths, gain)
        before = len(scene.crossings)
        found = []
        for turn, weighed in zip(turns, self._weighed(turns).tolist(), strict=True):
            score = min(weighed, turn.held.certainty)
            moves = before / (before - turn.after) if turn.after < before else before + 1
            found.append(Option(turn, score, score**moves * _seen_again(turn)))
        return sorted(found, key=lambda o: -o.chance)

    def _weighed(self, turns: list[Turn]) -> FloatArray:
        """``(T,)`` probabilities that the turns work."""
        learned = np.asarray(probabilities_of(self.classifier, [t.evidence for t in turns]))
        holds = np.array([t.held.body.center for t in turns]).reshape(-1, 2)
        return updated(learned, holds, np.array([t.angle for t in turns]), self.attempts)

    def with_what_follows(self, scene: Topology, option: Option) -> Option:
        """The option with its chance looked up in the scene that it leaves; behind a preparing one
        the best that follows is looked up, too, or what it makes possible seems better than it
        is."""
        chance = option.score * _seen_again(option.turn)
        left = after_turn(scene, option.turn)
        prepares = option.turn.after >= len(scene.crossings)
        if left.crossings:
            following = self.options(left, 1, _MOST_HOLDS_AHEAD)[:1]
            if not following and not prepares:
                following = self.options(left, 0, _MOST_HOLDS_AHEAD)[:1]
            elif prepares:
                following = [self.with_what_follows(left, o) for o in following]
            chance *= following[0].chance if following else _STUCK
        return replace(option, chance=chance * (_PREPARING if prepares else 1.0))


def _kind(option: Option) -> object:
    """Which crossings a turn parts, and how many are left: what follows is alike where these are
    the same."""
    return frozenset(k for k, _ in option.turn.held.parted), option.turn.after


def _in_light_of(option: Option, looked: Mapping[object, Option]) -> Option:
    """The option with its chance as that of its kind that was looked at, or as the least of them
    where none of its kind was."""
    example = looked.get(_kind(option))
    if example is None:
        least = min((o.chance for o in looked.values()), default=0.0)
        return replace(option, chance=min(option.chance, least))
    if example.turn is option.turn:
        return example
    here, there = (o.score * _seen_again(o.turn) for o in (option, example))
    return replace(option, chance=example.chance * min(1.0, here / max(there, 1e-9)))


def _seen_again(turn: Turn) -> float:
    """Chance that what the turn leaves can be planned for from the next picture."""
    return turn.in_view ** (_OUT_OF_VIEW if turn.after else 1)


def action_of(topology: Topology, turn: Turn, score: float, touching: int = -1) -> Action:
    """Hold at the pivot; pick where there is room, beyond the crossing if there is; place where the
    turn brings it."""
    pivot, body, angle = turn.held.pivot, turn.held.body, turn.angle
    k, place = turn.held.parted[0]
    picked, at = turn.held.pick
    section, held = topology.sections[picked], topology.sections[pivot.section]
    lengths = arc_lengths(section.xy)
    pick = point_at(section.xy, lengths, np.array([at]))[0]
    heading = _heading(section.xy, lengths, at)
    hold_at = float(np.clip(pivot.at, _INSIDE, max(held.length - _INSIDE, _INSIDE)))
    path = np.stack(
        [turned(pick, body.center, float(a)) for a in np.linspace(0, angle, _ARC_POINTS)]
    )
    return Action(
        k,
        place.section,
        pivot.branch,
        Grasp(as_pair(body.center), _heading(held.xy, arc_lengths(held.xy), hold_at)),
        Grasp(as_pair(pick), heading),
        Grasp(
            as_pair(path[-1]), float(np.arctan2(np.sin(heading + angle), np.cos(heading + angle)))
        ),
        path,
        angle,
        len(topology.crossings),
        turn.after,
        Sweep(topology, body).passed_over(angle),
        turn.clearance,
        turn.held.certainty,
        score,
        body.leaves_view,
        touching,
    )


def _heading(xy: FloatArray, lengths: FloatArray, at: float) -> float:
    before, after = point_at(xy, lengths, np.clip([at - _HEADING, at + _HEADING], 0, lengths[-1]))
    return float(np.arctan2(after[1] - before[1], after[0] - before[0]))


@dataclass(frozen=True)
class Base:
    """An arm's base in the picture's plane, px (it may be outside), and how far it reaches."""

    xy: tuple[float, float]
    reach: float = np.inf


def assign_arms(action: Action, bases: Sequence[Base]) -> tuple[int, int] | None:
    """Indices of the holding and the moving arm: the pair with the least distance to what each has
    to reach (6.7); None if neither way is within reach."""
    best: tuple[float, tuple[int, int]] | None = None
    for hold in range(len(bases)):
        for move in range(len(bases)):
            if hold == move:
                continue
            near = float(np.hypot(*np.subtract(bases[hold].xy, action.hold.xy)))
            far = float(np.hypot(*(action.trajectory - np.array(bases[move].xy)).T).max())
            if (
                near <= bases[hold].reach
                and far <= bases[move].reach
                and (best is None or near + far < best[0])
            ):
                best = (near + far, (hold, move))
    return None if best is None else best[1]
