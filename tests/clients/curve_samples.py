"""A reconstruction to test with: a straight cable of 20 cm along y, seen by three cameras, one of
them dropped."""

from __future__ import annotations

from dlo_client.contracts import (
    Curve3D,
    FileRef,
    Job,
    NextView,
    PinholeIntrinsics,
    ReconstructResult,
    Spline3,
    ViewOutcome,
)

from tests.clients import samples

INTRINSICS = PinholeIntrinsics(width=640, height=480, fx=600, fy=600, cx=320, cy=240)


def pose(x: float, y: float = 0.0, z: float = 0.25):
    """Looks down from there."""
    return ((1.0, 0.0, 0.0, x), (0.0, -1.0, 0.0, y), (0.0, 0.0, -1.0, z), (0.0, 0.0, 0.0, 1.0))


def straight(begin: float = -0.1, end: float = 0.1, count: int = 21) -> Curve3D:
    """Along y, standard deviations of 1 mm upward and 0.2 mm sideways."""
    at = [begin + (end - begin) * k / (count - 1) for k in range(count)]
    thirds = [begin + (end - begin) * k / 3 for k in range(4)]
    return Curve3D(
        points_m=[(0.0, y, 0.0) for y in at],
        covariance_m2=[(4e-8, 0.0, 0.0, 0.0, 0.0, 1e-6)] * count,
        sigma_m=[1e-3] * count,
        spline=Spline3(
            degree=3, knots=[0] * 4 + [1] * 4, control_m=[(0.0, y, 0.0) for y in thirds]
        ),
        radius_m=0.002,
        radius_sigma_m=1e-4,
        length_m=abs(end - begin),
    )


def result(curve: Curve3D | None = None, **fields) -> ReconstructResult:
    """``fields`` replace those of the result."""
    views = [
        ViewOutcome(
            name=name,
            status=status,
            reason=reason,
            instances_found=1,
            instance=1 if status == "used" else None,
            reprojection_px=0.25 if status == "used" else None,
            share=1.0,
            intrinsics=INTRINSICS,
            T_world_camera=pose(x),
        )
        for name, status, reason, x in (
            ("left", "used", None, -0.05),
            ("middle", "used", None, 0.0),
            ("right", "dropped", "the DLO was not <b>found</b>", 0.05),
        )
    ]
    given = {
        "method": "spline_bundle",
        "curve": curve or straight(),
        "others": [],
        "views": views,
        "reprojection_px": 0.25,
        "noise_px": 0.2,
        "overlap": None,
        "ends": ("border", "free"),
        "next_view": next_view(),
        "warnings": ["two views only"],
        "models": [],
    }
    return ReconstructResult(**(given | fields))


def next_view(y: float = 0.0) -> NextView:
    return NextView(
        baseline_m=0.08,
        delta_z_m=-0.05,
        T_world_camera=[pose(x, y, 0.2) for x in (-0.04, 0.0, 0.04)],
        sigma_m=1e-3,
        expected_sigma_m=4e-4,
        gain=0.6,
        visible=1.0,
    )


def job() -> Job[ReconstructResult]:
    files = [
        FileRef(name=f"overlay_{k}.png", media_type="image/png", bytes=1, sha256=samples.SHA)
        for k in range(3)
    ]
    made = samples.job(kind="reconstruct", result=result(), files=files)
    return Job[ReconstructResult].model_validate(made.model_dump())
