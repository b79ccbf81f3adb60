"""The gate of all label formats: here, and nowhere else, what another tool drew becomes instances.

Formats only say what is drawn (:class:`Drawn`). Everything is bounded before any pixel is set, so
that a broken picture costs itself and neither the process nor the other pictures.

=========================================================  =============================================================
handed in                                                  comes out
=========================================================  =============================================================
mask of the picture's size with pixels in it               the mask
polygon that covers pixels                                 filled
line of two points or more (several are joined, nearest    a stroke of its width; without one, of
ends first), no mask or polygon with it                    ``Wanted.line_width_px``, counted in the notes
polygon of two points, or there and back, with a width     a stroke of that width along it
the same without a width                                   refused: "… has neither an area nor a width"
a line beside a mask                                       the centerline
box, ellipse, cuboid, points, tag, skeleton of a wanted    refused: "box: no outline of a cable …"
class
nothing, an empty mask, one point, all of it outside       refused: "… covers no pixel of the picture" and the like
a number that is none, NaN or infinite                     refused: "… is not finite"
a point farther than a picture's size from the picture,    refused: "… far outside the picture", "… has more than …"
more than 100 000 points, 4 000 000 px along them
a picture of no size, above 100 000 000 px, or with more   refused: "its width is …", "… more than 10 000 …"
than 10 000 instances
another class, ``iscrowd``                                 left out; class, pictures and how many are in the notes
an id that is missing, taken, or no number from 1 on       a fresh one, above all that are or were in use
a crossing of a cable that is not there                    left out, in the notes
a crossing that does not say which cables, or unreadable   left out, in the notes
=========================================================  =============================================================
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from pydantic import ValidationError

from dlo_client.contracts import Crossing, Point
from dlo_client.labelling.formats.drawn import as_points, chained, inside, number, there, whole, yes
from dlo_client.labelling.formats.exchange import CLASS, Imported, Refused
from dlo_client.labelling.formats.pixels import Mask, Ring, encode, fill, mean_width, stroke
from dlo_client.labelling.formats.run_lengths import check
from dlo_client.labelling.labels import LabelledInstance, PictureLabel

MOST_PIXELS = 100_000_000
_LONGEST_SIDE = 65_535
_MOST_INSTANCES = 10_000
_HIGHEST_ID = 2**31 - 1
ABSENT = "crossing of a cable that is not there, left out"
UNSAID = "crossing that does not say which cables, left out"


@dataclass(frozen=True)
class Wanted:
    """What an import takes. ``classes``: what a DLO is called; ``line_width_px``: of lines that
    name no width; ``sizes``: name → (width, height) of the pictures that labels are wanted of, in
    their order, for files that do not say it; ``in_order``: frame k of a video is the k-th of them,
    whatever it is called."""

    classes: frozenset[str] = frozenset({CLASS})
    line_width_px: float = 6.0
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    in_order: bool = False

    def takes(self, name: object) -> bool:
        """Upper and lower case, and blanks around it, do not matter."""
        return str(name).strip().casefold() in {c.strip().casefold() for c in self.classes}


@dataclass
class Drawn:
    """What a tool holds of one DLO, as it stands there. ``place`` names it in messages. ``rings``
    are in continuous coordinates (pixel k reaches from k to k + 1), ``lines`` in ours (its center
    is k); a file's own size of a mask has been compared with the picture's."""

    place: str
    masks: list[Mask] = field(default_factory=list)
    rings: list[Ring] = field(default_factory=list)
    lines: list[Ring] = field(default_factory=list)
    number: object = None
    width_px: object = None
    closed: object = False


class Canvas:
    """One picture of a file that is read. All methods raise Refused."""

    def __init__(
        self, name: str, size: tuple[object, object], wanted: Wanted, imported: Imported
    ) -> None:
        """``size``: width and height as the file has them."""
        self.name, self._wanted, self._imported = name, wanted, imported
        self.width, self.height = checked_size(*size)
        self._instances: list[LabelledInstance] = []
        self._numbers: list[int | None] = []
        self._crossings: list[Crossing] = []

    def note(self, what: str, count: int = 1) -> None:
        self._imported.note(what, self.name, count)

    def leave_out(self, what: str) -> None:
        """Something that is not about cables."""
        self.note(f"{what[:80]} left out")

    def other_class(self, name: object) -> None:
        """A shape of a class that is not wanted."""
        self._imported.others.setdefault(self.name, set()).add(str(name)[:80])
        self.leave_out(f"class '{name}'")

    def points(self, raw: Ring, what: str) -> Ring:
        return inside(raw, self.width, self.height, what)

    def add(self, drawn: Drawn) -> None:
        """One DLO."""
        if len(self._instances) >= _MOST_INSTANCES:
            raise Refused(f"more than {_MOST_INSTANCES} instances")
        self._imported.taken += 1
        width_px = self._width(drawn)
        rings = [self.points(ring, drawn.place) for ring in drawn.rings]
        lines = [self.points(line, drawn.place) for line in drawn.lines]
        if any(len(line) < 2 for line in lines):
            raise Refused(f"{drawn.place} has less than two points")
        mask = self._filled(drawn.masks, rings)
        line = chained(lines) if lines else None
        if not mask.any():
            if not lines:
                lines = self._thin(drawn, rings, width_px)
                line = chained(lines)
            width_px = width_px or self._usual_width()
            mask = self._stroked(lines, width_px, yes(drawn.closed), drawn.place)
        self._put(drawn, mask, as_points(line) if line is not None else [], width_px)

    def cross(self, raw: object) -> None:
        """One crossing as :class:`Crossing` has it; its id does not matter."""
        try:
            given = dict(raw) if isinstance(raw, Mapping) else {}
            crossing = Crossing.model_validate(given | {"id": len(self._crossings) + 1})
            self.points(np.asarray([crossing.xy], float), "a crossing")
        except (ValidationError, Refused, OverflowError):
            self.note(UNSAID)
        else:
            self._crossings.append(crossing)

    def label(self, sha256: object = None) -> PictureLabel:
        """All of it, with ids that are told apart and crossings of what is there."""
        ids = self._ids()
        instances = [
            item.model_copy(update={"id": k}) for item, k in zip(self._instances, ids, strict=True)
        ]
        present = set(ids)
        kept = [c for c in self._crossings if {c.over.instance, c.under.instance} <= present]
        if len(kept) < len(self._crossings):
            self.note(ABSENT, len(self._crossings) - len(kept))
        return PictureLabel(
            name=self.name,
            sha256=sha256 if isinstance(sha256, str) and len(sha256) == 64 else None,
            width=self.width,
            height=self.height,
            instances=instances,
            crossings=[c.model_copy(update={"id": k}) for k, c in enumerate(kept, start=1)],
            origin="corrected",
        )

    def _ids(self) -> list[int]:
        """The first that claims a number keeps it. Fresh ones lie above all in use, also those of
        deleted cables that a crossing still names: a new cable must not take over another one's
        crossing."""
        named = [k for c in self._crossings for k in (c.over.instance, c.under.instance)]
        fresh = 1 + max(
            [k for k in (*self._numbers, *named) if k is not None and k < _HIGHEST_ID // 2],
            default=0,
        )
        taken: set[int] = set()
        ids = []
        for claimed in self._numbers:
            if claimed is None or claimed in taken:
                claimed, fresh = fresh, fresh + 1
            taken.add(claimed)
            ids.append(claimed)
        return ids

    def _width(self, drawn: Drawn) -> float | None:
        if drawn.width_px is None or drawn.width_px == "":
            return None
        got = number(drawn.width_px, f"the width of {drawn.place}")
        if not 0 < got <= max(self.width, self.height):
            raise Refused(
                f"the width of {drawn.place} is {got:g} px in a picture of {self.width}×{self.height}"
            )
        return got

    def _usual_width(self) -> float:
        usual = self._wanted.line_width_px
        self.note(f"line without a width, drawn {usual:g} px wide")
        return usual

    def _filled(self, masks: Sequence[Mask], rings: Sequence[Ring]) -> Mask:
        full = [ring for ring in rings if len(ring) >= 3 and there(ring) is None]
        mask = fill(full, self.height, self.width)
        for other in masks:
            if other.shape != mask.shape:
                raise Refused(
                    f"a mask of {other.shape[1]}×{other.shape[0]} for a picture of {self.width}×{self.height}"
                )
            mask |= other
        return mask

    def _thin(self, drawn: Drawn, rings: Sequence[Ring], width_px: float | None) -> list[Ring]:
        """Rings without an area as lines."""
        thin = [ring for ring in rings if len(ring) >= 2]
        if not thin or (
            width_px is None and any(len(ring) > 2 and there(ring) is None for ring in thin)
        ):
            raise Refused(f"{drawn.place} covers no pixel of the picture")
        if width_px is None:
            raise Refused(f"{drawn.place} has neither an area nor a width")
        ways = [(ring, there(ring)) for ring in thin]
        return [ring if way is None else way for ring, way in ways]

    def _stroked(self, lines: Sequence[Ring], width_px: float, closed: bool, place: str) -> Mask:
        mask = np.zeros((self.height, self.width), bool)
        for line in lines:
            mask |= stroke(
                as_points(line), width_px, self.height, self.width, closed and len(lines) == 1
            )
        if not mask.any():
            raise Refused(f"{place} covers no pixel of the picture")
        return mask

    def _put(self, drawn: Drawn, mask: Mask, line: list[Point], width_px: float | None) -> None:
        try:
            self._numbers.append(whole(drawn.number, "an id", 1, _HIGHEST_ID))
        except Refused:
            self._numbers.append(None)
        self._instances.append(
            LabelledInstance(
                id=1,
                centerline_xy=line,
                width_px=width_px or mean_width(mask),
                closed=yes(drawn.closed),
                mask_rle=encode(mask),
            )
        )


def no_outline(kind: str) -> Refused:
    """Of a shape of a wanted class that cannot be a cable."""
    return Refused(f"{kind}: no outline of a cable; draw a mask, a polygon or a line")


def checked_size(width: object, height: object) -> tuple[int, int]:
    """Raises Refused."""
    wide = whole(width, "its width", 1, _LONGEST_SIDE)
    high = whole(height, "its height", 1, _LONGEST_SIDE)
    if wide * high > MOST_PIXELS:
        raise Refused(f"{wide}×{high} is more than {MOST_PIXELS} px")
    return wide, high


def checked(label: PictureLabel, imported: Imported) -> PictureLabel:
    """A label of our own format: once it was in a file it is as foreign as any other. Raises
    Refused."""
    width, height = checked_size(label.width, label.height)
    if len(label.instances) > _MOST_INSTANCES:
        raise Refused(f"more than {_MOST_INSTANCES} instances")
    for item in label.instances:
        if item.mask_rle.size != (height, width):
            raise Refused(f"the mask of instance {item.id} is not of the picture's size")
        check(item.mask_rle.counts, height, width)
        inside(
            np.asarray(item.centerline_xy, float).reshape(-1, 2),
            width,
            height,
            f"instance {item.id}",
        )
    fresh = 1 + max((item.id for item in label.instances), default=0)
    ids: dict[int, LabelledInstance] = {}
    for item in label.instances:
        number, fresh = (fresh, fresh + 1) if item.id in ids else (item.id, fresh)
        ids[number] = item.model_copy(update={"id": number})
    kept = [c for c in label.crossings if {c.over.instance, c.under.instance} <= ids.keys()]
    if len(kept) < len(label.crossings):
        imported.note(ABSENT, label.name, len(label.crossings) - len(kept))
    return label.model_copy(update={"instances": list(ids.values()), "crossings": kept})


def settle(imported: Imported, wanted: Wanted) -> Imported:
    """The last step of a reader. Where nothing in the whole file is of a wanted class, its pictures
    are not free of cables, the file calls them something else: pictures with other shapes are
    refused then."""
    if imported.taken == 0 and imported.others:
        classes = ", ".join(sorted(f"'{c}'" for c in wanted.classes))
        for name, found in imported.others.items():
            named = ", ".join(sorted(f"'{c}'" for c in found))
            imported.refuse(
                name,
                f"nothing in the file is of the class {classes}; here {named}: say which are cables",
            )
        imported.labels = [label for label in imported.labels if label.name not in imported.others]
    return imported
