"""Cleaning the network of strands: what only the outline's unevenness makes is taken out (before thesis 6.4.2)."""

from __future__ import annotations

from collections import defaultdict

import cv2
import numpy as np

from models.geometry.arrays import BoolArray, ByteArray, Float32Array, FloatArray
from models.topology.skeleton import Strand, Web

_SMALLEST_AREA = 24
_SMALLEST_HOLE = 30
_SLIT = 0.4
"""A hole whose inscribed circle is smaller than this share of the typical half width is a slit within a bundle."""
_MOST_SLIT_AREA = 60.0
"""Larger holes, in squares of the typical half width, are not looked at."""
_SPUR = 0.5
"""A free end that reaches less than this share of the joint's radius beyond its disc is no branch."""
_CONTRACTED = 0.8
"""Joints nearer than this share of their radius are one place."""


def tidied(mask: BoolArray) -> BoolArray:
    """The mask without specks of a few pixels, and with the holes filled that no strand could pass: pinholes, and the
    slits between cables of one bundle. Each would make a ring of the skeleton."""
    binary = np.array(mask, dtype=np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(binary, connectivity=8)
    small = stats[:, cv2.CC_STAT_AREA] < _SMALLEST_AREA
    small[0] = False
    if count > 1 and small.any():
        binary[small[labels]] = 0
    _fill_slits(binary)
    return binary.view(np.bool_)


def _fill_slits(binary: ByteArray) -> None:
    """Fill, in place, holes of a few pixels and those narrower than a share of the typical strand."""
    background = 1 - binary
    count, labels, stats, _ = cv2.connectedComponentsWithStats(background, connectivity=4)
    if count <= 2:
        return
    inner = cv2.distanceTransform(binary, cv2.DIST_L2, cv2.DIST_MASK_3)
    half_width = 2 * float(np.median(inner[binary > 0])) if binary.any() else 0.0
    spaces = cv2.distanceTransform(background, cv2.DIST_L2, cv2.DIST_MASK_3)
    for k in range(1, count):
        left, top, width, height, area = stats[k]
        if area >= _MOST_SLIT_AREA * half_width**2 and area >= _SMALLEST_HOLE:
            continue
        window = np.s_[top : top + height, left : left + width]
        hole = labels[window] == k
        if area < _SMALLEST_HOLE or float(spaces[window][hole].max()) < _SLIT * half_width:
            binary[window][hole] = 1


def cleaned(web: Web, distances: Float32Array) -> Web:
    """The web without spurs and specks; joints that belong together are one, knots on a strand are dissolved."""
    web = contract(dissolve(web))
    for _ in range(3):
        kept = tuple(s for s in web.strands if not _is_spur(s, web))
        if len(kept) == len(web.strands):
            break
        web = contract(dissolve(Web(web.knots_xy, kept)))
    return compact(Web(web.knots_xy, tuple(s for s in web.strands if not _is_speck(s, web))))


def degrees(web: Web) -> dict[int, int]:
    """How many strands end at each knot; a ring counts twice."""
    count: dict[int, int] = defaultdict(int)
    for strand in web.strands:
        count[strand.a] += 1
        count[strand.b] += 1
    return count


def protrusion(strand: Strand, joint: int) -> float:
    """How far a strand reaches beyond the disc of the joint that it leaves, px."""
    seen = strand.seen_from(joint)
    return seen.length + float(seen.radii[-1]) - float(seen.radii[0])


def _is_spur(strand: Strand, web: Web) -> bool:
    count = degrees(web)
    for joint, tip in ((strand.a, strand.b), (strand.b, strand.a)):
        if count[tip] == 1 and count[joint] > 2:
            seen = strand.seen_from(joint)
            return seen.length - seen.radii[0] < _SPUR * seen.radii[0] + 2
    return False


def _is_speck(strand: Strand, web: Web) -> bool:
    """Alone, and hardly longer than wide."""
    count = degrees(web)
    if strand.a == strand.b or count[strand.a] != 1 or count[strand.b] != 1:
        return False
    thickness = 2 * float(strand.radii.max())
    return strand.length + thickness < max(2.2 * thickness, 16.0)


def dissolve(web: Web) -> Web:
    """Strands that meet two by two become one."""
    at: dict[int, list[Strand]] = defaultdict(list)
    for strand in web.strands:
        at[strand.a].append(strand)
        if strand.b != strand.a:
            at[strand.b].append(strand)
    for knot in list(at):
        pair = at[knot]
        if len(pair) != 2 or any(s.a == s.b for s in pair):
            continue
        first, second = pair[0].seen_from(knot).reversed(), pair[1].seen_from(knot)
        joined = first.followed_by(second)
        del at[knot]
        for end in {first.a, second.b}:
            at[end] = [s for s in at[end] if s is not pair[0] and s is not pair[1]] + [joined]
    kept = {id(s): s for strands in at.values() for s in strands}
    return Web(web.knots_xy, tuple(kept.values()))


def contract(web: Web) -> Web:
    """Joints that lie within each other's disc become one, at their middle."""
    count = degrees(web)
    parent = np.arange(len(web.knots_xy))

    def root(k: int) -> int:
        while parent[k] != k:
            k = int(parent[k])
        return k

    for s in web.strands:
        near = s.length <= _CONTRACTED * max(s.radii[0], s.radii[-1])
        if near and count[s.a] > 2 and count[s.b] > 2 and s.a != s.b:
            parent[root(s.a)] = root(s.b)
    roots = np.array([root(k) for k in range(len(parent))], dtype=np.int64)
    if np.array_equal(roots, np.arange(len(roots))):
        return web
    sizes = np.bincount(roots, minlength=len(roots))
    sums = np.stack([np.bincount(roots, web.knots_xy[:, axis], len(roots)) for axis in (0, 1)], axis=1)
    middle: FloatArray = sums / np.maximum(sizes, 1.0)[:, None]
    moved = (_moved(s, int(roots[s.a]), int(roots[s.b]), middle) for s in web.strands)
    kept = tuple(s for s in moved if s.a != s.b or s.length > 2 * s.radii.max() + 6)
    return Web(middle, kept)


def _moved(strand: Strand, a: int, b: int, knots: FloatArray) -> Strand:
    xy = strand.xy.copy()
    xy[0], xy[-1] = knots[a], knots[b]
    return Strand(a, b, xy, strand.radii)


def compact(web: Web) -> Web:
    """The web with only the knots that strands end at, numbered anew."""
    used = sorted({k for s in web.strands for k in (s.a, s.b)})
    new = {old: k for k, old in enumerate(used)}
    strands = tuple(Strand(new[s.a], new[s.b], s.xy, s.radii) for s in web.strands)
    return Web(web.knots_xy[used].reshape(-1, 2), strands)
