"""``dlo shape``: the shape controller on a simulated table, with pictures of what happened."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from dlo_client.client import Client
from dlo_client.commands.app import app
from dlo_client.commands.printing import print_lines
from dlo_client.contracts import DloObject
from dlo_client.demo.simulated_table import SimulatedTable, target_shape
from dlo_client.shape_control import ShapeController, ShapeOutcome


@app.command()
def shape(
    context: typer.Context,
    target: Annotated[
        Literal["U", "A", "S", "I"], typer.Argument(help="Shape to reach, from a straight line.")
    ],
    out: Annotated[
        Path | None, typer.Option(file_okay=False, help="Folder for task.gif and task.png.")
    ] = None,
    length: Annotated[
        float, typer.Option(min=0.05, max=2, help="Of the simulated rope, meters.")
    ] = 0.45,
    stiffness: Annotated[
        float, typer.Option(min=0, max=1, help="Of the simulated rope: 0 a chain, 1 a rod.")
    ] = 0.3,
    mass: Annotated[float, typer.Option(min=0.001, max=10, help="Kilograms.")] = 0.05,
    threshold: Annotated[
        float, typer.Option(min=1e-4, max=1, help="Mean distance to reach, meters.")
    ] = 0.01,
    max_actions: Annotated[int, typer.Option(min=1, max=100)] = 10,
    horizon: Annotated[int, typer.Option(min=1, max=4, help="Actions looked ahead.")] = 2,
) -> None:
    """Bring a simulated rope into a shape, learning what it is made of."""
    client: Client = context.obj
    table = SimulatedTable(length, stiffness=stiffness)
    goal = target_shape(target, length)
    controller = ShapeController(
        client,
        table,
        DloObject(mass_kg=mass),
        goal,
        threshold,
        max_actions=max_actions,
        horizon=horizon,
    )
    outcome = controller.run()
    lines = _report(target, outcome)
    if out is not None:
        from dlo_client.demo.shape_drawing import animate, plot

        out.mkdir(parents=True, exist_ok=True)
        animate(table.frames, goal, out / "task.gif")
        plot(outcome, threshold, out / "task.png")
        lines += [f"saved {out / 'task.gif'}", f"saved {out / 'task.png'}"]
    print_lines(lines)
    if not outcome.reached:
        raise typer.Exit(1)


def _report(target: str, outcome: ShapeOutcome) -> list[str]:
    """A row an action, and how it ended."""
    lines = ["action  edge   dx mm   dy mm  turn deg  predicted mm  reached mm    k_b    k_d"]
    for k, step in enumerate(outcome.steps, start=1):
        done, used = step.plan.action, step.plan.parameters
        assert done is not None
        lines.append(
            f"{k:6d}  {done.edge:4d}  {1e3 * done.dx_m:6.1f}  {1e3 * done.dy_m:6.1f}"
            f"  {57.2958 * done.dtheta_rad:8.1f}  {1e3 * done.error_after_m:12.1f}"
            f"  {1e3 * step.error_m:10.1f}  {used.k_b:5.3f}  {used.k_d:5.1f}"
        )
    ended = "reached" if outcome.reached else f"not reached: {outcome.reason}"
    reached_mm = 1e3 * outcome.errors_m[-1]
    return [*lines, f"{target}: {ended} after {len(outcome.steps)} actions, {reached_mm:.1f} mm"]
