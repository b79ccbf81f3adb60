"""``topology``: picture, or foreground mask, to the topology of the harnesses in it."""

from __future__ import annotations

from dlo_client.contracts import HarnessDrawing, TopologyRequest

from models.strands.stopwatch import Stopwatch
from models.topology.harness_drawing import Drawn, Match, match_drawing
from models.topology.overlay import overlay
from models.topology.scene import Topology
from workers.stages.encoding import OVERLAY_SIDE, mask_png, overlay_png
from workers.stages.harness_encoding import encode, section_names
from workers.stages.outcome import Outcome, Tools
from workers.stages.seen_harness import see_harness


def run(request: TopologyRequest, tools: Tools) -> Outcome:
    watch = Stopwatch()
    seen = see_harness(request, tools, watch)
    tools.progress(0.8)
    match = None
    if request.drawing is not None:
        with watch.step("match"):
            match = _match(seen.topology, request.drawing)
    with watch.step("encode"):
        result = encode(seen, match, request.drawing)
        files = {}
        if "overlay" in request.files:
            names = section_names(match) if match else None
            drawn = overlay(seen.foreground.picture, seen.topology, names, OVERLAY_SIDE)
            files["overlay.png"] = overlay_png(drawn)
        if "mask" in request.files:
            files["mask.png"] = mask_png(seen.foreground.probability)
    steps = {f"topology.{name}": ms for name, ms in seen.topology.timings_ms.items()}
    return Outcome(result, files, watch.timings_ms | steps)


def _match(topology: Topology, drawing: HarnessDrawing) -> Match:
    branches = [Drawn(b.name, b.a, b.b, b.length) for b in drawing.branches]
    return match_drawing(topology, branches, drawing.connectors, drawing.px_per_unit)
