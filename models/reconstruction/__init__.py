"""The 3D shape of DLOs from pictures at known poses (thesis chapter 4).

``reconstruct`` is the default method, ``dlo3ds`` the published one; ``view_planning``, ``tracking``
and ``merging`` lead the camera along a DLO and put the sections together. All in meters and *ideal*
pixels (see geometry.cameras).
"""
