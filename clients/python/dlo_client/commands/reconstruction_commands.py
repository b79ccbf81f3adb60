"""``dlo reconstruct`` and ``dlo scan``: the 3D shape of a cable, from pictures or with a camera on
an arm."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import TypeAdapter, ValidationError

from dlo_client.client import Client
from dlo_client.commands.app import Out, app
from dlo_client.commands.printing import print_error
from dlo_client.commands.saving import save
from dlo_client.contracts import CameraView, Curve3D, ReconstructRequest, Target
from dlo_client.contracts.reconstruction import Optimise, ReconstructMethod
from dlo_client.demo.scan_picture import svg
from dlo_client.errors import describe_fields
from dlo_client.outcomes import result_of
from dlo_client.scan import CameraOnArm, Scan, ScanOptions

_VIEWS: TypeAdapter[list[CameraView]] = TypeAdapter(list[CameraView])


@app.command()
def reconstruct(
    context: typer.Context,
    cameras: Annotated[
        Path, typer.Argument(help="JSON: a list of {intrinsics, T_world_camera}, one a picture.")
    ],
    images: Annotated[
        list[Path], typer.Argument(metavar="IMAGE...", help="The pictures, in the same order.")
    ],
    out: Out = None,
    method: Annotated[
        ReconstructMethod, typer.Option(help="spline_bundle, or the published one.")
    ] = "spline_bundle",
    target: Annotated[
        tuple[int, float, float] | None,
        typer.Option(help="View (from 0), x and y of a pixel on the cable."),
    ] = None,
) -> None:
    """The 3D curve of a cable in pictures from known poses."""
    client: Client = context.obj
    views = _read_views(cameras)
    chosen = Target(view=target[0], xy=target[1:]) if target else None
    job = client.run_job(ReconstructRequest(views=views, method=method, target=chosen), images)
    result = result_of(job)
    _print_curve(result.curve, f"reprojection {result.reprojection_px:.2f} px")
    for view in result.views:
        print(f"  {view.name}: {view.status}" + (f", {view.reason}" if view.reason else ""))
    for warning in result.warnings:
        print(f"  warning: {warning}")
    if out is not None:
        saved = save(client, job, out, cameras.stem)
        saved.append(
            _picture(out / f"{cameras.stem}.svg", result.curve, [v.T_world_camera for v in views])
        )
        for path in saved:
            print(f"  saved {path}")


@app.command()
def scan(
    context: typer.Context,
    arm: Annotated[
        str,
        typer.Option(
            help="module:name of a function without arguments that gives a CameraOnArm; looked for here too."
        ),
    ],
    out: Annotated[Path, typer.Option(file_okay=False, help="Folder for scan.svg and scan.json.")],
    views: Annotated[int, typer.Option(min=2, max=16, help="Pictures a section.")] = 3,
    optimise: Annotated[
        Optimise, typer.Option(help="What the service may choose: baseline, distance.")
    ] = "bz",
    overlap: Annotated[float, typer.Option(min=0.1, max=0.9)] = 0.5,
    nearest_m: Annotated[
        float, typer.Option(min=0.02, help="The camera comes no nearer to the cable.")
    ] = 0.12,
) -> None:
    """Follow a cable from the middle to both ends and put the sections together.

    A simulated arm: --arm models.synthesis.arm:long_cable, from the checkout.
    """
    client: Client = context.obj
    options = ScanOptions(views=views, optimise=optimise, overlap=overlap, nearest_m=nearest_m)
    result = Scan(client, _load(arm), options).run()
    _print_curve(result.curve, f"{len(result.sections)} sections; ended: {'; '.join(result.ended)}")
    out.mkdir(parents=True, exist_ok=True)
    poses = [pose for section in result.sections for pose in section.poses]
    (out / "scan.json").write_text(result.merged.model_dump_json(indent=2))
    print(f"  saved {_picture(out / 'scan.svg', result.curve, poses)}")
    print(f"  saved {out / 'scan.json'}")


def _read_views(cameras: Path) -> list[CameraView]:
    try:
        return _VIEWS.validate_json(cameras.read_bytes())
    except ValidationError as error:
        print_error(f"{cameras}: {describe_fields(error)}")
        raise typer.Exit(1) from error


def _load(name: str) -> CameraOnArm:
    """What ``module:function`` gives; the module may lie in the current folder."""
    module, _, factory = name.partition(":")
    sys.path.insert(0, str(Path.cwd()))
    try:
        made: Any = getattr(import_module(module), factory)()
    except (ImportError, AttributeError, TypeError, ValueError) as error:
        print_error(f"--arm {name}: {error}")
        raise typer.Exit(1) from error
    arm: CameraOnArm = made
    return arm


def _picture(path: Path, curve: Curve3D, cameras: list[Any]) -> Path:
    path.write_text(svg(curve, cameras))
    return path


def _print_curve(curve: Curve3D, more: str) -> None:
    radius = f", radius {1000 * curve.radius_m:.2f} mm" if curve.radius_m else ""
    sigma = 1000 * sum(curve.sigma_m) / len(curve.sigma_m)
    print(f"{curve.length_m:.3f} m{radius}, standard deviation {sigma:.2f} mm; {more}")
