"""Where a robot takes pictures of a scene from (thesis 2.5.1): a part of an ellipsoid, always
looking at its center."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.geometry.arrays import FloatArray
from models.geometry.cameras import look_at


@dataclass(frozen=True)
class Ellipsoid:
    """Eq. 2.3: semi-axes ``a, b, c`` in meters around ``center_m``; zenith angles ``theta_rad``
    from the vertical and azimuths ``phi_rad``, each from its first to its second value."""

    a: float
    b: float
    c: float
    center_m: tuple[float, float, float]
    theta_rad: tuple[float, float] = (0.15, 0.7)
    phi_rad: tuple[float, float] = (-np.pi, np.pi)

    def at(self, theta: FloatArray, phi: FloatArray) -> FloatArray:
        """(n, 3) points of the ellipsoid for (n,) zenith and azimuth angles: eq. 2.3."""
        x0, y0, z0 = self.center_m
        return np.stack(
            [
                self.a * np.sin(theta) * np.sin(phi) + x0,
                -self.b * np.sin(theta) * np.cos(phi) + y0,
                self.c * np.cos(theta) + z0,
            ],
            axis=-1,
        )


def ellipsoid_poses(ellipsoid: Ellipsoid, rings: int, per_ring: int) -> FloatArray:
    """(rings · per_ring, 4, 4) poses T_world_camera along rings of growing zenith angle, every
    other one backwards, so that the arm makes no long way between two pictures. The image's x axis
    stays as level as it can.

    Raises ValueError without a view, or for a camera straight above its target looking along its
    own vertical.
    """
    if min(rings, per_ring) < 1 or min(ellipsoid.a, ellipsoid.b, ellipsoid.c) <= 0:
        raise ValueError("an ellipsoid has positive axes, and a trajectory at least one view")
    thetas = np.linspace(*ellipsoid.theta_rad, rings)
    full = np.isclose(abs(ellipsoid.phi_rad[1] - ellipsoid.phi_rad[0]), 2 * np.pi)
    phis = np.linspace(*ellipsoid.phi_rad, per_ring, endpoint=not full)
    target = np.asarray(ellipsoid.center_m, np.float64)
    poses: list[FloatArray] = []
    for k, theta in enumerate(thetas):
        order = phis if k % 2 == 0 else phis[::-1]
        centers = ellipsoid.at(np.full(per_ring, theta), order)
        poses.extend(look_at(center, target, np.array([0.0, -1.0, 0.0])) for center in centers)
    return np.stack(poses)
