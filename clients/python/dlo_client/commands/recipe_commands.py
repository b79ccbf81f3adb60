"""``dlo recipes``, ``recipe-store``, ``recipe-run``, ``camera-store``: what a cell runs by
number."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from dlo_client.client import Client
from dlo_client.commands.app import AsJson, Out, app
from dlo_client.commands.printing import print_job_as_json, print_lines, print_rows
from dlo_client.commands.saving import save
from dlo_client.contracts import Job
from dlo_client.contracts.frames import RobotPoses
from dlo_client.contracts.recipes import LARGEST_NUMBER, CameraBody, RecipeBody

Number = Annotated[int, typer.Argument(min=0, max=LARGEST_NUMBER, help="Number of the recipe.")]
_YAML = (".yaml", ".yml")


@app.command()
def recipes(context: typer.Context) -> None:
    """List the recipes: number, version, name, kind, camera."""
    client: Client = context.obj
    stored = client.recipes()
    head = f"{len(stored)} recipes"
    print_lines(
        [
            head,
            *(
                f"{one.number:5}  version {one.version:3}  {one.name}  ({one.request.get('kind', '?')}"
                f"{f', camera {one.camera}' if one.camera else ''})"
                for one in stored
            ),
        ]
    )


@app.command("recipe-store")
def recipe_store(
    context: typer.Context,
    number: Number,
    recipe: Annotated[
        Path | None,
        typer.Argument(metavar="[JSON]", dir_okay=False, help="name, request, camera, output."),
    ] = None,
    job: Annotated[
        str | None, typer.Option(metavar="ID", help="Of a job that it repeats, instead of JSON.")
    ] = None,
) -> None:
    """Store a recipe; the next version if there is one."""
    client: Client = context.obj
    if (recipe is None) == (job is None):
        raise typer.BadParameter(
            "give the recipe's JSON or --job, one of the two", param_hint="JSON"
        )
    if recipe is not None:
        body = RecipeBody.model_validate_json(recipe.read_text(encoding="utf-8"))
    else:
        body = client.recipe_of(job or "")
    stored = client.store_recipe(number, body)
    print_lines([f"recipe {stored.number}, version {stored.version}: {stored.name}"])


@app.command("camera-store")
def camera_store(
    context: typer.Context,
    name: Annotated[str, typer.Argument(help="What recipes call it.")],
    calibration: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", dir_okay=False, help="JSON, or YAML of ROS, OpenCV or Kalibr."
        ),
    ],
) -> None:
    """Store a calibration; a YAML file brings the intrinsics and keeps the poses."""
    client: Client = context.obj
    if calibration.suffix.lower() in _YAML:
        stored = client.store_camera(name, calibration)
    else:
        stored = client.store_camera(
            name, CameraBody.model_validate_json(calibration.read_text(encoding="utf-8"))
        )
    print_lines([f"camera {stored.name}, version {stored.version}"])


@app.command("recipe-run")
def recipe_run(
    context: typer.Context,
    number: Number,
    images: Annotated[list[Path], typer.Argument(metavar="IMAGE", help="Its pictures, in order.")],
    out: Out = None,
    as_json: AsJson = False,
) -> None:
    """Run a recipe with these pictures, all of them in one job, and print the robot poses."""
    client: Client = context.obj
    job = client.run_recipe(number, images)
    saved = save(client, job, out, f"recipe-{number}") if out else []
    if as_json:
        print_job_as_json(images[0], job, saved)
    else:
        _print_poses(number, job, saved)


def _print_poses(number: int, job: Job[Any], saved: list[Path]) -> None:
    used = f"recipe {number}, version {job.recipe.version}" if job.recipe else f"recipe {number}"
    found = job.poses
    if found is None:
        print_rows(f"{used}: no output, so no poses", [], [], job, saved)
        return
    head = f"{used}: {len(found.poses)} poses of the {found.of} in {found.frame}, {found.unit}, {found.rotation}"
    print_rows(head, ["role", "id", "score", "x, y, z", "rotation"], _rows(found), job, saved)
    print_lines(f"  left out: {warning}" for warning in found.warnings)


def _rows(found: RobotPoses) -> list[list[str]]:
    return [
        [
            pose.role,
            str(pose.id),
            f"{pose.score:.2f}",
            ", ".join(f"{value:.6g}" for value in pose.position),
            ", ".join(f"{value:.6g}" for value in pose.rotation),
        ]
        for pose in found.poses
    ]
