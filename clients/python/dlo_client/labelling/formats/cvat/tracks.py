"""Tracks of CVAT's video XML as shapes frame by frame.

As in CVAT: a keyframe's shape holds until the next one, moving there evenly; an ``outside``
keyframe ends it until the next one that is not; after the last it stays to the end of the video.
What is between is taken from the file where it is written out (``keyframe="0"``). Lines and
outlines with as many points move point by point, others by equal shares of their length; masks and
shapes that change their kind stay as they were.

A frame's picture is the one called ``frame_000012`` (any suffix, any folder) or, with
``Wanted.in_order`` or when there are as many pictures as frames, the one at its place among all.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from xml.etree.ElementTree import Element

import numpy as np

from dlo_client.labelling.formats.cvat.writing import points_of
from dlo_client.labelling.formats.drawn import inside, whole
from dlo_client.labelling.formats.exchange import Imported, Refused
from dlo_client.labelling.formats.gate import Wanted
from dlo_client.labelling.formats.pixels import Ring
from dlo_client.polylines import arc_lengths

_MOST_FRAMES = 100_000
_LONGEST_SIDE = 65_535
_MOVING = ("polyline", "polygon")
_NAMED = re.compile(r"^frame_(\d+)$")


@dataclass
class Frame:
    """``size``: width and height of the video, if the file states them."""

    name: str
    size: tuple[object, object]
    shapes: list[Element] = field(default_factory=list)


@dataclass
class _Track:
    """``at``: numbers of the frames that are written out, rising; ``shapes``: what is there."""

    at: list[int]
    shapes: list[Element]


def frames_of(root: Element, wanted: Wanted, imported: Imported) -> list[Frame]:
    """Frames in which a track shows something. Tracks that cannot be read, and frames without a
    picture, are named."""
    tracks = []
    for k, element in enumerate(root.iter("track")):
        with imported.one_picture(f"track {element.get('id', k)}"):
            tracks.append(_track(element))
    if not tracks:
        return []
    size = (root.findtext(".//original_size/width"), root.findtext(".//original_size/height"))
    length = _length(root, tracks)
    names = _names(length, tracks, wanted, imported)
    frames = []
    for number, name in names.items():
        frame = Frame(name, size)
        with imported.one_picture(name):
            frame.shapes = [s for track in tracks if (s := _shown(track, number)) is not None]
            if frame.shapes:
                frames.append(frame)
            else:
                imported.not_annotated[name] = "no track shows anything there"
    return frames


def _track(element: Element) -> _Track:
    written: dict[int, Element] = {}
    for shape in element:
        if shape.get("frame") is None:
            continue
        number = whole(shape.get("frame"), "a frame's number", 0, _MOST_FRAMES)
        inherited = {key: element.get(key, "") for key in ("label", "group_id") if element.get(key)}
        own = {key: value for key, value in shape.attrib.items() if value}
        written[number] = _like(shape, inherited | own)
    return _Track(sorted(written), [written[k] for k in sorted(written)])


def _length(root: Element, tracks: Sequence[_Track]) -> int:
    """Frames of the video; at least up to the last that is written out."""
    seen = 1 + max((track.at[-1] for track in tracks if track.at), default=-1)
    try:
        return max(seen, whole(root.findtext(".//meta//size"), "the video's size", 0, _MOST_FRAMES))
    except Refused:
        return seen


def _names(
    length: int, tracks: Sequence[_Track], wanted: Wanted, imported: Imported
) -> dict[int, str]:
    """Frame → the picture that it is; with no pictures to compare with, CVAT's own names."""
    known = list(wanted.sizes)
    if not known:
        return {k: f"frame_{k:06d}" for k in range(length)}
    numbered = {int(m[1]): name for name in known if (m := _NAMED.match(PurePosixPath(name).stem))}
    names = {k: name for k, name in numbered.items() if k < length}
    if wanted.in_order or (not numbered and length == len(known)):
        names = dict(enumerate(known[:length]))
        imported.note(
            "frame taken as the picture at its place in the order of names", known[0], len(names)
        )
    missing = sorted({k for track in tracks for k in track.at} - names.keys())
    if missing:
        some = ", ".join(f"frame_{k:06d}" for k in missing[:5]) + (
            ", …" if len(missing) > 5 else ""
        )
        why = "no picture of this name; where frame k is the k-th picture by name, say --frames in-order"
        imported.refuse(f"{len(missing)} frames ({some})", why)
    return names


def _shown(track: _Track, number: int) -> Element | None:
    """What the track shows in a frame, or None."""
    place = bisect_right(track.at, number) - 1
    if place < 0 or track.shapes[place].get("outside") == "1":
        return None
    shape = track.shapes[place]
    if track.at[place] == number or place + 1 == len(track.at):
        return shape
    following = track.shapes[place + 1]
    if shape.tag not in _MOVING or following.tag != shape.tag or following.get("outside") == "1":
        return shape
    share = (number - track.at[place]) / (track.at[place + 1] - track.at[place])
    return _between(shape, following, share)


def _between(shape: Element, following: Element, share: float) -> Element:
    before, after = (_points(s) for s in (shape, following))
    if len(before) != len(after):
        before, after = _alike(before, after, shape.tag == "polygon")
    moved = (1 - share) * before + share * after
    return _like(shape, shape.attrib | {"points": ";".join(f"{x:.4f},{y:.4f}" for x, y in moved)})


def _like(shape: Element, attributes: dict[str, str]) -> Element:
    """The shape with other attributes. (A copy of an element shares them with it.)"""
    other = Element(shape.tag, attributes)
    other.extend(shape)
    return other


def _points(shape: Element) -> Ring:
    points = points_of(shape)
    if len(points) < 1:
        raise Refused(f"a {shape.tag} of a track has no points")
    return inside(points, _LONGEST_SIDE, _LONGEST_SIDE, f"a {shape.tag} of a track")


def _alike(before: Ring, after: Ring, closed: bool) -> tuple[Ring, Ring]:
    """Both with points at the shares of length at which either has one. A ring starts where the two
    are nearest."""
    if closed:
        start = int(np.hypot(*(after - before[0]).T).argmin())
        before, after = (
            np.concatenate([r, r[:1]]) for r in (before, np.roll(after, -start, axis=0))
        )
    shares = [_shares(line) for line in (before, after)]
    places = np.unique(np.concatenate(shares))
    both = [
        np.stack([np.interp(places, at, line[:, axis]) for axis in (0, 1)], 1)
        for at, line in zip(shares, (before, after), strict=True)
    ]
    return (both[0][:-1], both[1][:-1]) if closed else (both[0], both[1])


def _shares(line: Ring) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    way = arc_lengths(line)
    return np.asarray(way / way[-1] if way[-1] > 0 else np.linspace(0, 1, len(line)))
