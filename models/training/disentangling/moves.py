"""The network that gives how likely a turn is to work, trained in a simulated world of harnesses.

    python -m models.training topology_moves

Strategy: a harness with one to four crossings is on a table; what a camera sees of it is a
topology, from which turns are found. Some are done on the harness as it really is, each anew, by
arms that err; one that works leads on to the next state. A turn works if the piece could be taken,
as many crossings are gone as were foreseen, and the place is as easy to read as before: nothing
newly touches, crosses right beside a branch-point, or crosses out of sight. About an hour on one
core.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.disentangling.evidence import MOVE_FEATURES
from models.disentangling.hands import Frame, in_hands, usual_hand_px
from models.disentangling.hold_candidates import find_holds
from models.disentangling.plan import DisentangleParams, action_of
from models.disentangling.turn_candidates import Turn, find_turns
from models.geometry.arrays import FloatArray
from models.synthesis.harness import Harness
from models.synthesis.harness_masks import draw_mask
from models.topology.classifiers import Classifiers
from models.topology.evidence import classifiers_of
from models.topology.extraction import TopologyNetwork, extract
from models.topology.scene import Topology
from models.training.disentangling.table_world import (
    SEEN,
    execute,
    one_crossing,
    seen_points,
    truth,
    unclear,
)
from models.training.fit import Source
from models.training.state import kept
from models.training.topology.classifiers import ClassifierConfig, classifier
from models.training.topology.evidence import Table
from models.weights.inference import Runtime, default_name, load

MOVES = "topology_moves"
_FIRST, _HELD_OUT = 0, 10**6
_MOST_STEPS = 4
_MOST_TRIED = 14
_PREPARING = 0.2
"""Weight of a turn that leaves as many crossings."""
_AS_IT_IS, _NO_DEPTH = 0.15, 0.2
"""How often the topology is the true one, and how often no depth tells what lies on top."""


@dataclass(frozen=True)
class MovesConfig(ClassifierConfig):
    seed: int = 12
    epochs: int = 20
    scenes: int = 2400
    held_out: int = 100
    hidden: int = 48


def moves_table(
    seed: int, first: int, count: int, network: TopologyNetwork, classifiers: Classifiers
) -> Table:
    """Evidence of turns, and whether they worked, in scenes ``first`` to ``first + count`` of a
    seed."""
    rows: list[FloatArray] = []
    worked: list[bool] = []
    for k in range(first, first + count):
        rng = np.random.default_rng([seed, k])
        harness = one_crossing(rng, int(rng.integers(1, 5)))
        for _ in range(_MOST_STEPS):
            topology = _seen(harness, rng, network, classifiers)
            hand_px = usual_hand_px(topology)
            turns = _tried(topology, hand_px, rng)
            outcomes = [_done(harness, topology, turn, hand_px, rng) for turn in turns]
            rows += [t.evidence for t in turns]
            worked += [o is not None for o in outcomes]
            onward = [o for o in outcomes if o is not None]
            if not onward:
                break
            harness = onward[int(rng.integers(len(onward)))]
            if not harness.crossings:
                break
    return Table(np.array(rows, np.float32), np.array(worked, np.int64))


def _seen(
    harness: Harness, rng: np.random.Generator, network: TopologyNetwork, classifiers: Classifiers
) -> Topology:
    if rng.random() < _AS_IT_IS:
        return truth(harness)
    mask = draw_mask(harness, rng, SEEN)
    return extract(
        mask,
        network,
        classifiers,
        surfaces=[] if rng.random() < _NO_DEPTH else [seen_points(harness)],
    )


def _tried(topology: Topology, hand_px: float, rng: np.random.Generator) -> list[Turn]:
    """Some of the turns; more often those that are certain and that leave fewer crossings."""
    frame = Frame.of(topology, hand_px, 0.0)
    scene = in_hands(topology, hand_px)
    turns = find_turns(scene, find_holds(scene), frame, DisentangleParams.clearance_widths, 0)
    removed = np.array([len(topology.crossings) - t.after for t in turns])
    certain = np.array([t.held.certainty * (0.2 + t.in_view) for t in turns])
    weights = certain * np.where(removed > 0, 1.0, _PREPARING)
    keys = rng.random(len(turns)) ** (1 / weights)
    return [turns[k] for k in np.argsort(-keys)[:_MOST_TRIED]]


def _done(
    harness: Harness, topology: Topology, turn: Turn, hand_px: float, rng: np.random.Generator
) -> Harness | None:
    """The harness after the turn; None if it did not work."""
    outcome = execute(
        harness, action_of(in_hands(topology, hand_px), turn, 1.0).scaled(hand_px), rng
    )
    gone = len(harness.crossings) - len(outcome.harness.crossings)
    enough = outcome.moved and gone >= len(topology.crossings) - turn.after
    return outcome.harness if enough and unclear(outcome.harness) <= unclear(harness) else None


def samples(config: ClassifierConfig, source: Source) -> tuple[Table, Table]:
    """Turns in scenes for training and in held-out ones; they are tried once and kept."""
    runtime = Runtime(threads=1)
    network = load(default_name("topology"), runtime)
    classifiers = classifiers_of(lambda task: load(default_name(task), runtime))

    def table(first: int, count: int) -> Table:
        file = source.folder / f"turns-{config.seed}-{first}-{count}.pickle"
        return kept(file, lambda: moves_table(config.seed, first, count, network, classifiers))

    return table(_FIRST, config.scenes), table(_HELD_OUT, config.held_out)


FAMILY = classifier(
    MOVES,
    "moves",
    "evidence of turns about a place that is held",
    ("fails", "works"),
    MOVE_FEATURES,
    MovesConfig,
    samples,
)
