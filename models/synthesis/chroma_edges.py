"""The contour of a keyed mask: a pixel on it is part DLO and part screen, and the key counts all of
them as DLO.

Strategy: every pixel near the contour is compared with the two colors it can be mixed of, that of
the nearest sure DLO pixel F and that of the nearest sure screen pixel B. Its share of F (least
squares in RGB) decides whether it belongs to the mask. Where it does, it gets the color F, so that
no seam of screen color goes along to the new background (the artefact that thesis sections 2.3.2
and 2.8 name).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]

_KERNEL = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))


def refine(rgb: NDArray[np.uint8], keyed: Mask) -> tuple[Mask, NDArray[np.uint8]]:
    """The (H, W) mask with its contour at half coverage, and the picture (H, W, 3) with clean DLO
    colors there."""
    inside = _eroded(keyed)
    core = _eroded(inside)
    # A DLO too thin to be eroded twice keeps its middle.
    core |= inside & ~_dilated(core, 3)
    screen = ~_dilated(keyed)
    if not core.any() or not screen.any():
        return keyed, rgb
    picture = cv2.GaussianBlur(rgb, (3, 3), 0).astype(np.float32)
    front, behind = _nearest(picture, core), _nearest(picture, screen)
    across = front - behind
    share = ((rgb - behind) * across).sum(-1) / np.maximum((across**2).sum(-1), 1.0)
    mask = core | (keyed & (share > 0.5))
    edge = mask & ~core
    clean = rgb.copy()
    clean[edge] = front[edge].astype(np.uint8)
    return mask, clean


def _nearest(picture: NDArray[np.float32], where: Mask) -> NDArray[np.float32]:
    """For every pixel the color of the nearest one in ``where``."""
    _, labels = cv2.distanceTransformWithLabels(
        (~where).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    colors = np.zeros((int(labels.max()) + 1, 3), np.float32)
    colors[labels[where]] = picture[where]
    return colors[labels]


def _eroded(mask: Mask) -> Mask:
    # What goes on beyond the picture's border is not eroded there.
    return np.asarray(cv2.erode(mask.astype(np.uint8), _KERNEL, borderValue=1) > 0)


def _dilated(mask: Mask, times: int = 1) -> Mask:
    return np.asarray(cv2.dilate(mask.astype(np.uint8), _KERNEL, iterations=times) > 0)
