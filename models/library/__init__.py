"""Perception and handling of deformable linear objects (cables, wires, ropes), as functions on
arrays.

Pictures are ``(H, W, 3)`` uint8 RGB, masks ``(H, W)``, points ``(x, y)`` in pixels with the center
of the first pixel at ``(0, 0)``; lengths and poses in space are in meters. A wrong argument raises
:class:`ArgumentError`, a ValueError that names it. Networks are part of the package and are loaded
on first use, once a process.
"""

from models.disentangling.plan import Action, DisentangleParams
from models.geometry.cameras import Camera, CameraError, Intrinsics
from models.instances.overlay import overlay
from models.instances.published.ariadne_plus import AriadnePlusParams
from models.instances.published.fastdlo import FastDloParams
from models.instances.published.rt_dlo import RtDloParams
from models.instances.scene import Crossing, Endpoint, Instance, Scene
from models.instances.section_matching import SectionMatchingParams
from models.library.arguments import ArgumentError
from models.library.handling import ShapeAction, estimate_parameters, plan_disentangle, plan_shape
from models.library.loading import configure, networks
from models.library.perception import Foreground, instances, segment, topology
from models.library.space import Curve, NotReconstructable, label_tracked, reconstruct
from models.library.version import __version__
from models.manipulation.limits import Limits
from models.manipulation.parameters import Estimate
from models.topology.scene import Topology
from models.tracked_labels.strokes import StrokeError
from models.tracked_labels.tracked import TrackedView

__all__ = [
    "Action",
    "ArgumentError",
    "AriadnePlusParams",
    "Camera",
    "CameraError",
    "Crossing",
    "Curve",
    "DisentangleParams",
    "Endpoint",
    "Estimate",
    "FastDloParams",
    "Foreground",
    "Instance",
    "Intrinsics",
    "Limits",
    "NotReconstructable",
    "RtDloParams",
    "Scene",
    "SectionMatchingParams",
    "ShapeAction",
    "StrokeError",
    "Topology",
    "TrackedView",
    "__version__",
    "configure",
    "estimate_parameters",
    "instances",
    "label_tracked",
    "networks",
    "overlay",
    "plan_disentangle",
    "plan_shape",
    "reconstruct",
    "segment",
    "topology",
]
