"""One picture to its foreground, its DLOs, or the topology of its harnesses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from models.geometry.arrays import BoolArray, ByteArray, Float32Array
from models.instances.lookalikes import without_lookalikes
from models.instances.methods import METHODS
from models.instances.published.ariadne_plus import AriadnePlusParams
from models.instances.published.fastdlo import FastDloParams
from models.instances.published.rt_dlo import RtDloParams
from models.instances.scene import Scene
from models.instances.section_matching import SectionMatchingParams
from models.instances.settling import settle
from models.library import arguments, loading
from models.library.arguments import ArgumentError
from models.segmentation import segment as foreground
from models.segmentation.effort import PASSES, Effort, look
from models.topology.evidence import classifiers_of
from models.topology.extraction import extract
from models.topology.order import depth_map
from models.topology.scene import Topology

Method = Literal["section_matching", "rt_dlo", "fastdlo", "ariadne_plus"]
MethodParams = SectionMatchingParams | RtDloParams | FastDloParams | AriadnePlusParams


@dataclass(frozen=True, eq=False)
class Foreground:
    """``probability`` ``(H, W)`` of a DLO; ``mask`` ``(H, W)``, what counts as foreground at
    ``threshold``."""

    probability: Float32Array
    mask: BoolArray
    threshold: float


def segment(
    picture: ArrayLike,
    *,
    model: str | None = None,
    threshold: float | None = None,
    effort: Effort = "normal",
) -> Foreground:
    """The foreground of a picture (thesis chapter 2), settled: without what is hardly a cable, with
    what of a cable the network lost.

    ``picture``: ``(H, W, 3)`` uint8 RGB. ``model``: a network of the task ``foreground``.
    ``threshold``: 0 to 1; with one, the mask is the network's probability cut there; without,
    patches that are small or not certain are left out, and the probability agrees with it.
    ``effort``: how hard to look, ``fast``, ``normal`` or ``thorough``.

    Raises ArgumentError.
    """
    return _foreground(arguments.picture(picture, "picture"), model, threshold, effort)[0]


def _foreground(
    image: ByteArray, model: str | None, threshold: float | None, effort: Effort
) -> tuple[Foreground, Scene | None]:
    """As :func:`segment`, and the strands by the default method that settled it."""
    if effort not in PASSES:
        raise ArgumentError("effort", f"is {effort!r}; there are {', '.join(PASSES)}")
    network = loading.foreground(model, PASSES[effort].eight_bit)
    settings = foreground.ForegroundInput.from_manifest(network.spec.preprocess)
    limit = None if threshold is None else arguments.number(threshold, "threshold", 0, 1)
    probability = look(image, network, settings, effort)
    mask = foreground.foreground_mask(probability, settings, limit)
    if limit is not None:
        return Foreground(probability, mask, limit), None
    seen = settle(image, probability, mask, settings.threshold)
    return Foreground(seen.probability, seen.cable, settings.threshold), seen.scene


def instances(
    picture: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    *,
    method: Method = "section_matching",
    params: MethodParams | None = None,
    model: str | None = None,
    threshold: float | None = None,
    effort: Effort = "normal",
) -> Scene:
    """The DLOs of a picture, of a mask, or of a mask with the picture's colors.

    ``picture``: ``(H, W, 3)`` uint8 RGB. ``mask``: ``(H, W)`` bool, integers (not 0: foreground) or
    probabilities; without it the foreground is found with ``model``, ``threshold`` and ``effort``
    as in :func:`segment`. ``params``: those of the ``method``.

    Raises ArgumentError.
    """
    if method not in METHODS:
        raise ArgumentError("method", f"is {method!r}; there are {', '.join(METHODS)}")
    chosen = METHODS[method]
    if params is not None and type(params) is not chosen.params:
        raise ArgumentError(
            "params", f"are {type(params).__name__}; {method} takes {chosen.params.__name__}"
        )
    seen, image, settled = _seen(picture, mask, model, threshold, effort)
    if settled is not None and method == "section_matching" and params is None:
        return settled
    networks = [loading.default(task) for task in chosen.tasks]
    scene = chosen.extract(seen.mask, image, params or chosen.params(), networks)
    if mask is not None or image is None:
        return scene
    return without_lookalikes(scene, seen.probability, seen.mask, image)


def topology(
    picture: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    *,
    depth_m: ArrayLike | None = None,
    model: str | None = None,
    threshold: float | None = None,
    effort: Effort = "normal",
) -> Topology:
    """Sections, branch-points and crossings of wire harnesses (thesis chapter 6).

    ``picture``, ``mask``, ``model``, ``threshold`` and ``effort`` as for :func:`instances`;
    ``depth_m``: ``(H, W)`` meters to the camera, 0 or NaN where unknown: it shows which strand is
    on top.

    Raises ArgumentError.
    """
    found, image, _ = _seen(picture, mask, model, threshold, effort)
    seen = found.mask
    surfaces = []
    if depth_m is not None:
        depth = arguments.depth(depth_m, "depth_m")
        arguments.same_size(seen, depth, ("picture" if mask is None else "mask", "depth_m"))
        surfaces.append(depth_map(depth))
    classifiers = classifiers_of(loading.default)
    return extract(seen, loading.default("topology"), classifiers, image, surfaces)


def _seen(
    picture: ArrayLike | None,
    mask: ArrayLike | None,
    model: str | None,
    threshold: float | None,
    effort: Effort,
) -> tuple[Foreground, ByteArray | None, Scene | None]:
    """Foreground; the picture if there is one; the strands by the default method where they settled
    it."""
    if picture is None and mask is None:
        raise ArgumentError("picture", "or a mask is needed")
    image = None if picture is None else arguments.picture(picture, "picture")
    if mask is None:
        assert image is not None
        found, settled = _foreground(image, model, threshold, effort)
        return found, image, settled
    limit = None if threshold is None else arguments.number(threshold, "threshold", 0, 1)
    given = arguments.mask(mask, "mask", limit)
    if image is not None:
        arguments.same_size(image, given, ("picture", "mask"))
    return Foreground(given.astype(np.float32), given, 0.5 if limit is None else limit), image, None
