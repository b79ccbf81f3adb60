"""In words, where found labels differ from true ones."""

from __future__ import annotations

import cv2
import numpy as np

_PART = 0.2
"""Share of a cable (or of what was found) from which on it counts."""
_SEEN = 0.5


def why(found: np.ndarray, true: np.ndarray, mask: np.ndarray) -> str:
    """What is wrong with the ``(H, W)`` labels, given the foreground mask that they were made from.

    By share of pixels: a true cable in several pieces, several cables in one, found where there is
    none, not found (because the mask has it not, or although it has); with none of these, how well
    the outlines agree.
    """
    if found.shape != true.shape:
        found = cv2.resize(found, true.shape[::-1], interpolation=cv2.INTER_NEAREST)
        mask = (
            cv2.resize(mask.astype(np.uint8), true.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
        )
    cables, pieces = (np.unique(labels)[np.unique(labels) > 0] for labels in (true, found))
    both = np.array(
        [[np.sum((found == p) & (true == c)) for c in cables] for p in pieces], dtype=float
    )
    both = both.reshape(len(pieces), len(cables))
    of_piece = both / np.array([np.sum(found == p) for p in pieces]).reshape(-1, 1)
    of_cable = both / np.array([np.sum(true == c) for c in cables]).reshape(1, -1)
    said = []
    for k, cable in enumerate(cables):
        holders = int((of_cable[:, k] >= _PART).sum())
        if holders > 1:
            said.append(f"cable {cable} in {holders} pieces")
        elif holders == 0:
            seen = float(mask[true == cable].mean())
            said.append(f"cable {cable} not found, {100 * seen:.0f} % of it in the mask")
    for k, piece in enumerate(pieces):
        held = cables[of_piece[k] >= _PART]
        if len(held) > 1:
            said.append(f"{piece} joins cables {' and '.join(map(str, held))}")
        elif len(held) == 0:
            said.append(f"{piece} is no cable")
    if not said:
        overlap = np.sum((found > 0) & (true > 0)) / max(np.sum((found > 0) | (true > 0)), 1)
        lost = 1 - float(mask[true > 0].mean()) if (true > 0).any() else 0.0
        said.append(
            f"outlines: foreground IoU {100 * overlap:.0f}, {100 * lost:.0f} % of the cables unmasked"
        )
    return "; ".join(said)
