"""A simulated person in front of the corrector, who knows the true mask of a cable: where the next
click goes.

The first two clicks go on the ends of the cable, unless the service has found it. Then, as in
RITM's protocol, every action goes where the error is largest: a click on the true centerline where
the outline left the cable, else a drag of one edge or both; where a cable of the service goes on
beyond the true end, that is dragged back first. Where the outline lies beside the label, or is
wider or narrower, alike all along, the cable is dragged as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter1d
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree
from skimage.morphology import skeletonize

from models.geometry.arrays import BoolArray, FloatArray

SEEN_PX = 0.25
"""A person does not see (and pull away) less than this."""

WHOLE_LEAVES = 0.5
"""A person drags the whole cable where that leaves at most this share of the edges' error."""

_SPECK_PX = 12
_MARGIN_PX = 6
_NEAR = 8  # points of the drawn line over which an edge's error is averaged
_LOOK_PX = 45


@dataclass
class Person:
    """``mask`` (H, W) of the cable that is wanted, ``others`` of all other cables; ``hand_px`` is
    the standard deviation of the hand, drawn from ``rng``."""

    mask: BoolArray
    others: BoolArray
    hand_px: float = 0.0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))

    def __post_init__(self) -> None:
        line = true_line(self.mask)
        self.line = line
        self.width_px = float(self.mask.sum() / max(len(line), 1))
        self._clicked = [0, len(line) - 1] if len(line) > 1 else []
        self._hand = {i: self._shaken(line[i]) for i in self._clicked}
        self.pulls: list[dict[str, Any]] = []
        self.moved: dict[str, Any] | None = None
        self.whole: dict[str, Any] | None = None
        self._given: list[list[float]] | None = None
        self._drags = 0

    def corrects(self, drawn: dict[str, Any]) -> None:
        """Begins with what the page has ``drawn``, or goes on with it, in place of clicks of one's
        own: ``moved`` says from which place of the line to where it is dragged next."""
        if self._given is None:
            self._clicked = []
        self._given = drawn["clicks"]
        self.goes_on(drawn)

    def goes_on(self, drawn: dict[str, Any]) -> None:
        """The last drag is done: ``whole`` was one of the whole cable, with its clicks and
        pulls."""
        if self.whole:
            by = np.array(self.whole["by"])
            self._hand = {i: xy + by for i, xy in self._hand.items()}
            self.pulls = drawn["pulls"]
        self.moved = self.whole = None

    @property
    def clicks(self) -> list[list[float]]:
        """In the order along the cable."""
        return (
            [self._hand[i].tolist() for i in sorted(self._clicked)]
            if self._given is None
            else self._given
        )

    @property
    def actions(self) -> int:
        return len(self._clicked) + self._drags

    def act(self, drawn: dict[str, Any]) -> bool:
        """One more click or drag, seeing what the page has ``drawn``, with its ``mask`` (H, W);
        False when there is nothing left to see."""
        line = np.array(drawn["line"])
        if self._given is not None and self._shorten(line):
            return True
        at = np.rint(self.line).astype(int)
        outside = distance_transform_edt(~drawn["mask"])[at[:, 1], at[:, 0]]
        outside[self._clicked] = 0
        worst = int(np.argmax(outside))
        if outside[worst] > self.width_px / 4:
            self._clicked.append(worst)
            self._hand[worst] = self._shaken(self.line[worst])
            if self._given is not None:
                nearest = int(np.argmin(np.linalg.norm(line - self.line[worst], axis=1)))
                self.moved = {"index": nearest, "to": self._hand[worst].tolist()}
            return True
        return self._pull(line, drawn)

    def _shorten(self, line: FloatArray) -> bool:
        """Drags an end back that goes on by more than a width where no cable is."""
        size = np.array(self.mask.shape[::-1]) - 1
        at = np.clip(np.rint(line).astype(int), 0, size)
        own = self.mask[at[:, 1], at[:, 0]]
        nothing = ~own & ~self.others[at[:, 1], at[:, 0]] & ((line >= 0) & (line <= size)).all(1)
        if not own.any():
            return False
        step = float(np.linalg.norm(line[1:] - line[:-1], axis=1).mean())
        first, last = np.nonzero(own)[0][[0, -1]]
        beyond = [step * nothing[:first].sum(), step * nothing[last + 1 :].sum()]
        if max(beyond) <= self.width_px:
            return False
        end, reached = ((0, first), (len(line) - 1, last))[int(np.argmax(beyond))]
        to = min(
            (self.line[0], self.line[-1]),
            key=lambda true: float(np.linalg.norm(true - line[reached])),
        )
        self.moved = {"index": end, "to": self._shaken(to).tolist()}
        self._drags += 1
        return True

    def _pull(self, line: FloatArray, drawn: dict[str, Any]) -> bool:
        normals = np.array(drawn["normals"])
        size = np.array(self.mask.shape[::-1]) - 1
        inside = ((line >= 0) & (line <= size)).all(1)
        edges = [np.array(drawn["low"]), np.array(drawn["high"])]
        off = [
            self._off(line, normals, edge, side, inside)
            for edge, side in zip(edges, (-1, 1), strict=True)
        ]
        if self._carry(normals, off[0], off[1]):
            return True
        i = int(np.argmax(np.abs(off[0]) + np.abs(off[1])))
        drag = best_drag(float(off[0][i]), float(off[1][i]))
        if max(np.abs(drag)) < SEEN_PX:
            return False
        self._drags += 1
        shake = self._shake()
        for edge, side, by in zip(edges, (-1, 1), drag, strict=True):
            if by:
                at = line[i] + (edge[i] + by + shake * np.sign(by)) * normals[i]
                self.pulls.append({"at": at.tolist(), "side": side})
        return True

    def _carry(self, normals: FloatArray, low: FloatArray, high: FloatArray) -> bool:
        """Drags the whole cable, its width or one of its edges where the errors (n,) are alike all
        along."""
        known = (low != 0) & (high != 0)
        if not known.any():
            return False
        normals, low, high = normals[known], low[known], high[known]
        by = np.linalg.lstsq(normals, (low + high) / 2, rcond=None)[0].astype(np.float64)
        wider = float(np.median(high - low) / 2)
        along = normals @ by
        ends = float(np.median(low)), float(np.median(high))
        ways: list[tuple[float, float, dict[str, Any]]] = [
            (
                _sum(low - along, high - along),
                float(np.abs(along).max()),
                {"by": by.tolist(), "wider": 0.0},
            ),
            (_sum(low + wider, high - wider), abs(wider), _out(wider)),
            (_sum(low - ends[0], high), abs(ends[0]), _out(-ends[0], -1)),
            (_sum(low, high - ends[1]), abs(ends[1]), _out(ends[1], 1)),
        ]
        left, size, way = min(ways, key=lambda one: one[0])
        if size < SEEN_PX or left > WHOLE_LEAVES * _sum(low, high):
            return False
        moves = any(way["by"])
        self.whole = way | (
            {"by": self._shaken(by).tolist()} if moves else {"wider": way["wider"] + self._shake()}
        )
        self._drags += 1
        return True

    def _off(
        self, line: FloatArray, normals: FloatArray, edge: FloatArray, side: int, inside: BoolArray
    ) -> FloatArray:
        """(n,) how far along the normal the edge should move, averaged along the line; 0 where
        nobody can tell."""
        pairs = zip(line, side * normals, strict=True)
        true = np.array(
            [side * edge_px(self.mask, self.others, point, outward) for point, outward in pairs]
        )
        known = ~np.isnan(true) & inside
        missing = np.where(known, np.clip(true - edge, -self.width_px, self.width_px), 0)
        weight = gaussian_filter1d(known.astype(float), _NEAR, mode="constant")
        average = gaussian_filter1d(missing, _NEAR, mode="constant") / np.maximum(weight, 0.2)
        return np.asarray(np.where(known, average, 0), np.float64)

    def _shake(self) -> float:
        return float(self.rng.normal(0, self.hand_px)) if self.hand_px else 0.0

    def _shaken(self, xy: FloatArray) -> FloatArray:
        return np.asarray(
            xy + self.rng.normal(0, self.hand_px, 2) if self.hand_px else xy, np.float64
        )


def _out(wider: float, side: int = 0) -> dict[str, Any]:
    return {"by": [0.0, 0.0], "wider": wider, "side": side}


def _sum(low: FloatArray, high: FloatArray) -> float:
    return float(np.abs(low).sum() + np.abs(high).sum())


def best_drag(low: float, high: float) -> tuple[float, float]:
    """What the page offers in one drag, so that least is left of both edges' errors: one edge, both
    together, or both apart (the width)."""
    shift, wider = (low + high) / 2, (high - low) / 2
    choices = [(low, 0.0), (0.0, high), (shift, shift), (-wider, wider)]
    return min(choices, key=lambda by: abs(low - by[0]) + abs(high - by[1]))


def true_line(mask: BoolArray) -> FloatArray:
    """(n, 2) from end to end of a cable: the skeletons of its pieces, joined where others pass over
    it."""
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    pieces = [labels == k for k in range(1, count)]
    lines = [_skeleton(piece) for piece in pieces if np.count_nonzero(piece) >= _SPECK_PX]
    lines = [line for line in lines if len(line)]
    while len(lines) > 1:
        ways = [
            (float(np.linalg.norm(a[-1] - b[0])), i, j, a, b)
            for i, first in enumerate(lines)
            for j, second in enumerate(lines[:i])
            for a in (first, first[::-1])
            for b in (second, second[::-1])
        ]
        _, i, j, a, b = min(ways, key=lambda way: way[:3])
        lines = [line for k, line in enumerate(lines) if k not in (i, j)] + [np.vstack([a, b])]
    return _to_the_ends(lines[0], mask) if lines else np.zeros((0, 2))


def _skeleton(piece: BoolArray) -> FloatArray:
    """The longest path through one piece's skeleton. Beyond the border the cable goes on, or the
    skeleton would fork into the corners."""
    y, x = np.nonzero(skeletonize(np.pad(piece, _MARGIN_PX, mode="edge")))
    points = np.stack([x, y], 1) - _MARGIN_PX
    pairs = cKDTree(points).query_pairs(1.5, output_type="ndarray")
    if not len(pairs):
        return np.zeros((0, 2))
    length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    graph = coo_matrix((length, pairs.T), shape=(len(x), len(x))).tocsr()
    first = int(np.argmax(_finite(dijkstra(graph, directed=False, indices=0))))
    reached, before = dijkstra(graph, directed=False, indices=first, return_predecessors=True)
    path = [int(np.argmax(_finite(reached)))]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    line = points[path].astype(np.float64)
    return line[((line >= 0) & (line < np.array(piece.shape[::-1]))).all(1)]


def _finite(values: FloatArray) -> FloatArray:
    return np.where(np.isfinite(values), values, -1)


def _to_the_ends(line: FloatArray, mask: BoolArray) -> FloatArray:
    """The line goes on straight to where the mask ends: a skeleton stops before that, or forks into
    a corner."""
    size = np.array(mask.shape[::-1])
    half = int(np.ceil(0.5 * mask.sum() / len(line)))
    for _ in range(2):
        line = line[: -half or None] if len(line) > 6 * half else line
        step = line[-1] - line[-1 - min(2 * half, len(line) - 1)]
        more = line[-1] + np.arange(1, _LOOK_PX)[:, None] * step / (np.linalg.norm(step) + 1e-9)
        at = np.rint(more).astype(int)
        valid = ((at >= 0) & (at < size)).all(1)
        at = np.clip(at, 0, size - 1)
        on = valid & mask[at[:, 1], at[:, 0]]
        line = np.vstack([line, more[: len(on) if on.all() else int(np.argmin(on))]])[::-1]
    return line


def edge_px(mask: BoolArray, others: BoolArray, xy: FloatArray, outward: FloatArray) -> float:
    """How far from ``xy`` along the unit vector ``outward`` the mask ends; NaN where another cable
    or the border of the picture hides it."""
    distance = np.arange(-6, _LOOK_PX, 0.25)
    at = np.rint(xy + distance[:, None] * outward).astype(int)
    keep = ((at >= 0) & (at < np.array(mask.shape[::-1]))).all(1)
    distance, at = distance[keep], at[keep]
    own = mask[at[:, 1], at[:, 0]]
    if not own.any():
        return float("nan")
    here = int(np.searchsorted(distance, 0))
    before = np.nonzero(own[: here + 1])[0]
    start = int(before[-1]) if len(before) else int(np.argmax(own))
    rest = np.nonzero(~own[start:])[0]
    if not len(rest):
        return float("nan")
    end = start + int(rest[0])
    hidden = others[at[end : end + 5, 1], at[end : end + 5, 0]].any()
    return float("nan") if hidden else float(distance[end] - 0.125)
