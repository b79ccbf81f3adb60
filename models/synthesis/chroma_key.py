"""A recording before a green or blue screen to a labelled set with other backgrounds (thesis 2.3
and 2.7.1).

    python -m models.synthesis.chroma_key SOURCE OUT --backgrounds FOLDER --per-image 8 --seed 0 --show report.png
    python -m models.synthesis.chroma_key SOURCE OUT --backgrounds FOLDER --hue 96 159 --saturation 0.2 0.6
    python -m models.synthesis.chroma_key SOURCE OUT --backgrounds FOLDER --page ranges.html

SOURCE is a video or a folder of pictures. The screen's hue, saturation and value ranges are found,
or taken as given, printed and, with --show, drawn. --page writes a page on which they are picked by
eye, and nothing else. Every picture gives --per-image pictures with new backgrounds, and itself.
OUT can be read as a labelled set at any time; a run that stopped is continued by the same command.
"""

from __future__ import annotations

import argparse
import errno
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from models.synthesis.chroma_edges import refine
from models.synthesis.chroma_page import page
from models.synthesis.chroma_ranges import (
    ScreenRanges,
    find_ranges,
    foreground,
    of_screen_hue,
    to_hsv,
)
from models.synthesis.chroma_report import report
from models.synthesis.chroma_source import frames, spread
from models.synthesis.chroma_swap import (
    Backgrounds,
    blend,
    open_backgrounds,
    vary_background,
    vary_foreground,
)
from models.synthesis.datasets import append_index, read_index, write_sample, write_whole

SETTINGS = "chroma_key.json"
_SCREEN_HUE_SHARE = 0.006  # of a picture: a thing this large with the screen's hue is no noise
_REPORTED = 6

Rgb = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Given = dict[str, tuple[float, float]]
"""Ranges that the user knows, by the names of :class:`ScreenRanges`."""


@dataclass(frozen=True)
class KeyParams:
    """``per_image`` swapped pictures each (thesis: 8); every ``every``-th picture; ``blend_px``
    bounds of eq. 2.1's Gaussian."""

    per_image: int = 8
    seed: int = 0
    every: int = 1
    blend_px: tuple[float, float] = (0.5, 1.2)


@dataclass(frozen=True)
class Keyed:
    """A picture, its ``mask`` (H, W), the picture with clean DLO colors on the mask's contour, and
    whether a DLO of the screen's own hue may be missing in the mask."""

    picture: Rgb
    mask: Mask
    clean: Rgb
    screen_hue: bool


def key(picture: Rgb, ranges: ScreenRanges) -> Keyed:
    """Separate what stands before the screen (2.3.1) in an (H, W, 3) picture."""
    hsv = to_hsv(picture)
    mask, clean = refine(picture, foreground(hsv, ranges))
    return Keyed(picture, mask, clean, of_screen_hue(hsv, ranges) > _SCREEN_HUE_SHARE)


def swap(
    keyed: Keyed, background: Rgb, rng: np.random.Generator, blend_px: tuple[float, float]
) -> Rgb:
    """One new picture (2.3.2): both layers varied apart, then merged by eq. 2.1."""
    behind = vary_background(background, keyed.mask.shape, rng)
    return blend(
        vary_foreground(keyed.clean, rng), behind, keyed.mask, float(rng.uniform(*blend_px))
    )


def make_set(
    source: Path, out: Path, backgrounds: Backgrounds, ranges: ScreenRanges, params: KeyParams
) -> None:
    """Write what is still missing in ``out``. Picture k of the recording depends on the seed and k
    alone."""
    done = {record["name"] for record in read_index(out)}
    for k, picture in frames(source, params.every):
        names = [f"{k:06d}", *(f"{k:06d}_{n}" for n in range(params.per_image))]
        if done.issuperset(names):
            continue
        keyed = key(picture, ranges)
        background = backgrounds.draw(np.random.default_rng([params.seed, k]))
        for n, name in enumerate(names):
            if name in done:
                continue
            rng = np.random.default_rng([params.seed, k, n])
            # The recorded picture itself belongs to the set too (2.7.1).
            rgb = swap(keyed, background, rng, params.blend_px) if n else picture
            write_sample(out, name, rgb, keyed.mask)
            append_index(
                out, {"name": name, "picture": k, "swapped": n > 0, "screen_hue": keyed.screen_hue}
            )


def prepare(
    source: Path, out: Path, params: KeyParams, show: Path | None, given: Given | None = None
) -> ScreenRanges:
    """The ranges of the recording: those that ``out`` was begun with, else found now, but for the
    ``given`` ones. ValueError when ``out`` was begun with other settings."""
    settings: dict[str, Any] = {"source": str(source.resolve()), **asdict(params)}
    if given:
        settings["ranges"] = {name: list(bounds) for name, bounds in given.items()}
    file = out / SETTINGS
    begun = json.loads(file.read_text()) if file.exists() else None
    if begun is not None and begun["settings"] != json.loads(json.dumps(settings)):
        raise ValueError(f"{out} was begun with other settings ({file}); choose another folder")
    pictures: Sequence[Rgb] = ()
    if begun is None or show:
        pictures, _ = spread(source, params.every)
    ranges = _ranges(pictures, given or {}) if begun is None else _ranges_from(begun["ranges"])
    if show:
        shown = pictures[:_REPORTED]
        sheet = report(shown, [key(picture, ranges).mask for picture in shown], ranges)
        write_whole(show, cv2.imencode(".png", sheet[:, :, ::-1])[1].tobytes())
    if begun is None:
        out.mkdir(parents=True, exist_ok=True)
        write_whole(
            file, json.dumps({"settings": settings, "ranges": asdict(ranges)}, indent=1).encode()
        )
    return ranges


def _ranges(pictures: Sequence[Rgb], given: Given) -> ScreenRanges:
    """The ``given`` ranges, the others found; nothing has to be found where all three are given."""
    bounds = given if len(given) == 3 else {**_bounds(find_ranges(pictures)), **given}
    found = ScreenRanges(bounds["hue_deg"], bounds["saturation"], bounds["value"], 0.0)
    pixels = np.concatenate([to_hsv(picture)[::2, ::2].reshape(-1, 3) for picture in pictures])
    return replace(found, share=float(found.contain(pixels).mean()))


def _bounds(ranges: ScreenRanges) -> Given:
    return {"hue_deg": ranges.hue_deg, "saturation": ranges.saturation, "value": ranges.value}


def _given(args: argparse.Namespace) -> Given:
    """The ranges of the command line. Raises ValueError naming the option."""
    given: Given = {}
    for option, name, top in (
        ("hue", "hue_deg", 360.0),
        ("saturation", "saturation", 1.0),
        ("value", "value", 1.0),
    ):
        bounds = getattr(args, option)
        if bounds is None:
            continue
        low, high = bounds
        if not 0 <= low < high <= top:
            raise ValueError(
                f"--{option} {low:g} {high:g}: two numbers from 0 to {top:g}, the smaller one first"
            )
        given[name] = (low, high)
    return given


def _ranges_from(stored: dict[str, Any]) -> ScreenRanges:
    hue, saturation, value = (tuple(stored[name]) for name in ("hue_deg", "saturation", "value"))
    return ScreenRanges(hue, saturation, value, stored["share"])


def _tell(ranges: ScreenRanges) -> None:
    for name, (low, high) in _bounds(ranges).items():
        print(f"screen {name.replace('_deg', ' (degrees)')}: {low:.4g} to {high:.4g}")
    print(f"screen share of the pictures: {ranges.share:.1%}")


def _conclude(out: Path) -> None:
    records = read_index(out)
    pictures = {record["picture"]: record["screen_hue"] for record in records}
    print(f"{len(records)} labelled pictures from {len(pictures)} in {out}")
    affected = sum(pictures.values())
    if affected:
        print(
            f"warning: {affected} of {len(pictures)} pictures ({affected / len(pictures):.0%}) show something of the "
            "screen's own hue; parts of a DLO may be missing in their masks (screen_hue in the index)",
            file=sys.stderr,
        )


def main(arguments: Sequence[str] | None = None) -> int:
    args = _parser().parse_args(arguments)
    params = KeyParams(args.per_image, args.seed, args.every)
    try:
        given = _given(args)
        if args.page:
            pictures, _ = spread(args.source, params.every)
            write_whole(args.page, page(pictures[:_REPORTED], _ranges(pictures, given)).encode())
            print(f"open {args.page} in a browser; it shows the options to copy")
            return 0
        backgrounds = open_backgrounds(args.backgrounds)
        ranges = prepare(args.source, args.out, params, args.show, given)
        _tell(ranges)
        make_set(args.source, args.out, backgrounds, ranges, params)
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        if error.errno != errno.ENOSPC:
            raise
        print(
            f"error: the disk is full; {len(read_index(args.out))} pictures in {args.out} are whole. "
            "Make room and run the same command again.",
            file=sys.stderr,
        )
        return 1
    _conclude(args.out)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m models.synthesis.chroma_key",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "source", type=Path, help="video, or folder of pictures, before a green or blue screen"
    )
    parser.add_argument(
        "out", type=Path, help="folder of the set; continued when it was begun before"
    )
    parser.add_argument(
        "--backgrounds", type=Path, required=True, help="folder of pictures, or a pack (.npz)"
    )
    parser.add_argument(
        "--per-image", type=int, default=8, help="new pictures of each recorded one"
    )
    parser.add_argument("--every", type=int, default=1, help="take every n-th frame")
    parser.add_argument("--seed", type=int, default=0)
    for option, unit in (
        ("hue", "degrees, 0 to 360"),
        ("saturation", "0 to 1"),
        ("value", "0 to 1"),
    ):
        parser.add_argument(
            f"--{option}",
            type=float,
            nargs=2,
            metavar=("LOW", "HIGH"),
            help=f"the screen's, {unit}, instead of what is found",
        )
    parser.add_argument(
        "--page", type=Path, metavar="HTML", help="write a page to pick the ranges by eye"
    )
    parser.add_argument(
        "--show", type=Path, metavar="PNG", help="draw histograms, ranges and first masks"
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
