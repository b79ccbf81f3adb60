"""``plan_disentangle``: a topology, or a picture, to ranked dual-arm actions that remove a
crossing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, islice
from typing import Literal

import numpy as np
from dlo_client.contracts import (
    ArmBase,
    DisentangleAction,
    DisentangleRequest,
    DisentangleResult,
    GripperPose,
)
from dlo_client.contracts.disentangling import Attempt as AttemptGiven
from numpy.typing import NDArray

from models.disentangling.carried import Done, readings
from models.disentangling.evidence import MOVE_FEATURES
from models.disentangling.expectations import Attempt
from models.disentangling.overlay import draw_action
from models.disentangling.plan import (
    UNSURE_BELOW,
    Action,
    Base,
    DisentangleParams,
    Grasp,
    assign_arms,
    proposed,
)
from models.strands.stopwatch import Stopwatch
from models.topology import scene as found
from models.topology.overlay import overlay
from models.weights.inference import Network, default_name
from workers.stages.encoding import model_used, overlay_png
from workers.stages.foreground import check_size
from workers.stages.harness_encoding import decode, encode
from workers.stages.outcome import Outcome, Tools
from workers.stages.pictures import read_picture
from workers.stages.seen_harness import SeenHarness, see_harness

PlanStatus = Literal["planned", "unsure", "no_crossing", "no_action"]
_Pair = tuple[str | None, str | None]
"""Names of the holding and the moving arm."""


def run(request: DisentangleRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    seen: SeenHarness | None = None
    if request.topology is None:
        seen = see_harness(request, tools, watch)
        known = _readings(request, seen.topology, watch)
    else:
        known = [decode(request.topology)]
    tools.progress(0.6)
    network = moves_network(tools)
    with watch.step("plan"):
        hand_px = None if request.gripper is None else request.gripper.pixels
        done = [_attempt(a) for a in request.attempts]
        settings = DisentangleParams(
            hand_px, margin_px=request.margin_px, at_most=request.at_most, attempts=done
        )
        for topology in known:
            any_helps, feasible = _within_reach(proposed(topology, network, settings), request)
            if any_helps:
                break
        else:
            topology = known[0]
    with watch.step("encode"):
        height, width = topology.size
        status, message = _status(topology, any_helps, [a for a, _ in feasible])
        result = DisentangleResult(
            width=width,
            height=height,
            status=status,
            message=message,
            actions=[
                _action(k, a, arms, topology.size) for k, (a, arms) in enumerate(feasible, start=1)
            ],
            topology=None if seen is None else encode(replace(seen, topology=topology)),
            carried=len(known) > 1 and topology is known[0],
            reference=seen.foreground.references if seen else [],
            warnings=seen.remarks if seen else [],
            models=[*(seen.models if seen else []), model_used(network.spec)],
        )
        files = {}
        if "overlay" in request.files:
            picture = overlay(_ground(request, seen, topology, tools), topology)
            best = draw_action(picture, feasible[0][0]) if feasible else picture
            files["overlay.png"] = overlay_png(best)
    return Outcome(result, files, watch.timings_ms)


def _readings(
    request: DisentangleRequest, seen: found.Topology, watch: Stopwatch
) -> list[found.Topology]:
    """What to plan on, the best first. Raises InvalidInput where the earlier picture was of another
    size."""
    if request.earlier is None:
        return [seen]
    before, action = decode(request.earlier.topology, "earlier.topology"), request.earlier.action
    check_size("earlier.topology", before.size, "picture", seen.size)
    with watch.step("carry"):
        return readings(before, Done(action.hold.xy, action.pick.xy, action.turn_rad), seen)


def moves_network(tools: Tools) -> Network:
    """The network that gives how likely a turn is to work."""
    return tools.network(default_name("moves")).weighing(MOVE_FEATURES)


def _attempt(given: AttemptGiven) -> Attempt:
    done = given.action
    return Attempt(done.hold.xy, done.turn_rad, done.score, given.crossings <= done.crossings_after)


def _within_reach(
    actions: Iterator[Action], request: DisentangleRequest
) -> tuple[bool, list[tuple[Action, _Pair]]]:
    """Whether there is any action; and of those that the arms reach as many as are asked for."""
    first = next(actions, None)
    if first is None:
        return False, []
    assigned = ((a, _arms(a, request.arms)) for a in chain([first], actions))
    reached = ((a, arms) for a, arms in assigned if arms is not None)
    return True, list(islice(reached, request.at_most))


def _arms(action: Action, bases: list[ArmBase]) -> _Pair | None:
    """Names of the holding and the moving arm; None if the action is out of their reach."""
    if not bases:
        return None, None
    chosen = assign_arms(action, [Base(b.xy, b.reach_pixels) for b in bases])
    return None if chosen is None else (bases[chosen[0]].name, bases[chosen[1]].name)


def _status(
    topology: found.Topology, any_helps: bool, feasible: list[Action]
) -> tuple[PlanStatus, str]:
    if not topology.crossings:
        return "no_crossing", "there is no crossing to remove"
    if not any_helps:
        return (
            "no_action",
            "no section can be turned so that crossings go: they are held at both ends, or meet others",
        )
    if not feasible:
        return "no_action", "every action that helps is out of the arms' reach"
    count, best = len(topology.crossings), feasible[0]
    outcome = f"{len(feasible)} actions, the best leaves {best.after} of {count} crossings"
    if all(a.after >= a.before for a in feasible):
        outcome = f"no move leaves fewer than {count} crossings, {len(feasible)} prepare one"
    if best.score < UNSURE_BELOW:
        return (
            "unsure",
            f"unsure: the best action works with probability {best.score:.2f} only; {outcome}",
        )
    return "planned", outcome


def _action(rank: int, action: Action, arms: _Pair, size: tuple[int, int]) -> DisentangleAction:
    holder, mover = arms
    return DisentangleAction(
        rank=rank,
        crossing=action.crossing + 1,
        section=action.section + 1,
        about_branch_point=action.branch + 1 if action.branch >= 0 else None,
        touching_branch_point=action.touching + 1 if action.touching >= 0 else None,
        hold=_pose(action.hold, holder),
        pick=_pose(action.pick, mover),
        trajectory_xy=[(x, y) for x, y in np.round(action.trajectory, 2).tolist()],
        place=_pose(action.place, mover),
        turn_rad=round(action.turn, 4),
        crossings_before=action.before,
        crossings_after=action.after,
        passes_over=[k + 1 for k in action.passed],
        clearance_px=round(action.clearance, 2),
        score=round(min(1.0, max(0.0, action.score)), 4),
        why=_why(action, size),
    )


def _why(action: Action, size: tuple[int, int]) -> str:
    about = (
        f"branch-point {action.branch + 1}" if action.branch >= 0 else "a place along the section"
    )
    parts = [
        f"turning section {action.section + 1} by {np.rad2deg(action.turn):.0f}° about {about} "
        f"leaves {action.after} of {action.before} crossings",
        f"it is on top with probability {action.certainty:.2f}",
    ]
    if action.after >= action.before:
        parts.append("it only makes another move possible")
    if action.clearance < 0:
        parts.append("it then touches another section")
    if action.touching >= 0:
        parts.append(
            f"this supposes that branch-point {action.touching + 1} is a mere touch: look closer before"
        )
    if action.leaves_view:
        parts.append(
            "part of the piece is outside the picture: whether it is free there is not known"
        )
    if not all(0 <= x < size[1] and 0 <= y < size[0] for x, y in (action.hold.xy, action.pick.xy)):
        parts.append("it is held or picked outside the picture, where an earlier one showed it")
    return "; ".join(parts)


def _pose(grasp: Grasp, arm: str | None) -> GripperPose:
    x, y = grasp.xy
    return GripperPose(xy=(round(x, 2), round(y, 2)), angle_rad=round(grasp.angle, 4), arm=arm)


def _ground(
    request: DisentangleRequest, seen: SeenHarness | None, topology: found.Topology, tools: Tools
) -> NDArray[np.uint8]:
    """The picture to draw on: the one that was sent, or black."""
    if seen is not None:
        return seen.foreground.picture
    if request.image is None:
        return np.zeros((*topology.size, 3), np.uint8)
    image = read_picture(request.image, "image", tools).rgb
    check_size("image", image.shape[:2], "topology", topology.size)
    return image
