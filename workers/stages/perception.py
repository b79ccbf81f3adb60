"""Foreground to DLO instances, on arrays: what ``instances``, ``reconstruct`` and ``plan_shape``
share."""

from __future__ import annotations

from dataclasses import dataclass

from dlo_client.contracts import ModelUsed
from dlo_client.contracts.foreground import ForegroundOptions
from dlo_client.contracts.methods import DEFAULT_METHOD, InstanceMethod, MethodParams

from models.depth.order import reordered
from models.instances.lookalikes import without_lookalikes
from models.instances.methods import Extract
from models.instances.scene import Scene
from models.strands.stopwatch import Stopwatch
from workers.stages.depth import SeenDepth
from workers.stages.encoding import model_used
from workers.stages.foreground import Foreground, Source, find_foreground, settled
from workers.stages.instance_methods import extract_with
from workers.stages.outcome import Tools


@dataclass(frozen=True)
class Perception:
    """What was seen in one picture, and how long each step took."""

    source: Source
    scene: Scene
    foreground: Foreground
    models: list[ModelUsed]
    timings_ms: dict[str, float]


def perceive(
    source: Source,
    tools: Tools,
    options: ForegroundOptions,
    *,
    threshold: float | None = None,
    view: int | None = None,
    method: InstanceMethod = DEFAULT_METHOD,
    params: MethodParams | None = None,
    depth: SeenDepth | None = None,
) -> Perception:
    """The whole chain, for the ``view`` of several or the one picture; a ``depth`` counts for the
    foreground and the order at crossings. Raises InvalidInput as find_foreground does."""
    watch = Stopwatch()
    with watch.step("segment"):
        foreground = find_foreground(source, tools, options, threshold, view, depth)
    with watch.step("settle"):
        foreground = settled(foreground, source, options, threshold)
    extract, networks = extract_with(method, params, tools)
    with watch.step("instances"):
        scene = _instances(
            foreground, source, extract, known=method == DEFAULT_METHOD and params is None
        )
        if depth is not None:
            scene = reordered(scene, depth.depth_m)
    models = [*foreground.models, *(model_used(network.spec) for network in networks)]
    timings = watch.timings_ms | {f"instances.{name}": ms for name, ms in scene.timings_ms.items()}
    return Perception(source, scene, foreground, models, timings)


def _instances(foreground: Foreground, source: Source, extract: Extract, *, known: bool) -> Scene:
    """What a method finds; ``known``: it is the one that settled the foreground."""
    if known and foreground.scene is not None:
        return foreground.scene
    scene = extract(foreground.cable, source.image)
    if source.mask is not None or source.image is None:
        return scene
    return without_lookalikes(scene, foreground.probability, foreground.cable, source.image)
