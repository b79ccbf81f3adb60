"""``python -m models.synthesis pack | render | samples | kinds``: background pool, labelled
pictures, bundled ones, plates of every kind."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

import numpy as np
import torch

from models.synthesis.canvas import Canvas
from models.synthesis.clutter import Style
from models.synthesis.kinds import LOOKALIKES, SCENES, lookalike_plate, scene_plate
from models.synthesis.paint import mural
from models.synthesis.scenes import Labelled, SceneParams, render_scene, to_uint8
from models.synthesis.textures import TexturePool, load_pool, pack


def murals(count: int, seed: int, pool: TexturePool) -> list[np.ndarray]:
    """``count`` pictures of thrown paint (270, 480, 3) for the background pool."""
    pictures = []
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        canvas = Canvas(pool.sample(rng, (270, 480), torch.device("cpu")).contiguous())
        mural(canvas, rng)
        pictures.append(to_uint8(canvas.rgb))
    return pictures


# The scene of each bundled picture: style and number under the seed.
_SAMPLES: tuple[tuple[Style, int], ...] = (("plain", 4), ("busy", 50), ("industrial", 22))
_SAMPLES_SEED = 2026


def samples(args: argparse.Namespace) -> None:
    """The three pictures that come with the project."""
    import cv2

    pool = load_pool(args.textures)
    args.out.mkdir(parents=True, exist_ok=True)
    for style, number in _SAMPLES:
        params = SceneParams(
            (360, 640), (0.014, 0.04), max_cables=5, empty_share=0.0, clutter=1.0, style=style
        )
        scene = render_scene(np.random.default_rng([_SAMPLES_SEED, number]), params, pool)
        file = args.out / f"{style}.jpg"
        cv2.imwrite(str(file), to_uint8(scene.rgb)[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 92])


def kinds(args: argparse.Namespace) -> None:
    """A plate of every kind of scene and of clutter."""
    import cv2

    pool = load_pool(args.textures)
    plates = {name: scene_plate(name, pool) for name in SCENES}
    plates |= {name: lookalike_plate(name, pool) for name in LOOKALIKES}
    args.out.mkdir(parents=True, exist_ok=True)
    for name, picture in plates.items():
        cv2.imwrite(
            str(args.out / f"{name}.jpg"), picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 80]
        )


def render(args: argparse.Namespace) -> None:
    """Picture, instance ids and a line of ``scenes.jsonl`` per scene."""
    import cv2

    pool = load_pool(args.textures)
    params = SceneParams((args.height, args.width), clutter=args.clutter, style=args.style)
    renderer = _renderer(args.renderer)
    args.out.mkdir(parents=True, exist_ok=True)
    with (args.out / "scenes.jsonl").open("w") as lines:
        for k in range(args.count):
            scene = renderer(np.random.default_rng([args.seed, k]), params, pool)
            cv2.imwrite(str(args.out / f"{k:06d}.png"), to_uint8(scene.rgb)[:, :, ::-1])
            cv2.imwrite(str(args.out / f"{k:06d}_ids.png"), scene.ids.numpy().astype(np.uint8))
            lines.write(json.dumps({"id": k, **truth_record(scene)}) + "\n")


def truth_record(scene: Labelled, stride: int = 8) -> dict[str, Any]:
    """What ``scenes.jsonl`` holds of a scene: pixels and radians, every ``stride``-th sample of the
    centerlines (x, y, height); sample numbers of crossings count in the shortened centerlines."""
    crossings = [
        asdict(c)
        | {"xy": [round(v, 2) for v in c.xy]}
        | {"over_sample": c.over_sample // stride, "under_sample": c.under_sample // stride}
        for c in scene.crossings
    ]
    return {
        "widths_px": [round(w, 2) for w in scene.widths_px],
        "centerlines_xyz": [np.round(c[::stride], 3).tolist() for c in scene.centerlines],
        "visible": [v[::stride].astype(int).tolist() for v in scene.visible],
        "crossings": crossings,
        "camera": {
            "K": scene.camera.K.tolist(),
            "T_camera_world": scene.camera.T_camera_world.tolist(),
            "parallax": scene.camera.parallax,
        },
    }


def _renderer(name: str) -> Callable[[np.random.Generator, SceneParams, TexturePool], Labelled]:
    if name == "path_traced":
        from models.synthesis.path_traced import render_path_traced  # an optional extra

        return render_path_traced
    return render_scene


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m models.synthesis", description=__doc__)
    commands = parser.add_subparsers(required=True)
    packing = commands.add_parser(
        "pack", help="folder of textures to one .npz, with painted murals added"
    )
    packing.add_argument("folder", type=Path)
    packing.add_argument("target", type=Path)
    packing.add_argument("--murals", type=int, default=120)
    packing.set_defaults(run=_pack)
    rendering = commands.add_parser("render", help="write labelled pictures")
    rendering.add_argument("out", type=Path)
    rendering.add_argument("--count", type=int, default=16)
    rendering.add_argument("--seed", type=int, default=0)
    rendering.add_argument("--width", type=int, default=640)
    rendering.add_argument("--height", type=int, default=360)
    rendering.add_argument(
        "--textures", type=Path, help="a pack or a folder; without it backgrounds are noise"
    )
    rendering.add_argument(
        "--renderer",
        choices=("composited", "path_traced"),
        default="composited",
        help="path_traced needs requirements/photoreal.in",
    )
    rendering.add_argument("--style", choices=get_args(Style), default="mixed")
    rendering.add_argument(
        "--clutter", type=float, default=0.8, help="share of pictures with clutter"
    )
    rendering.set_defaults(run=render)
    bundled = commands.add_parser("samples", help="write the three bundled pictures")
    bundled.add_argument("out", type=Path)
    bundled.add_argument(
        "--textures", type=Path, required=True, help="folder that holds ambientcg128 alone"
    )
    bundled.set_defaults(run=samples)
    plates = commands.add_parser(
        "kinds", help="write a plate of every kind of scene and of clutter"
    )
    plates.add_argument("out", type=Path)
    plates.add_argument(
        "--textures", type=Path, help="a pack or a folder; without it backgrounds are noise"
    )
    plates.set_defaults(run=kinds)
    args = parser.parse_args()
    args.run(args)


def _pack(args: argparse.Namespace) -> None:
    painted = murals(args.murals, 0, load_pool(args.folder))
    print(pack(args.folder, args.target, {"murals": painted}), "pictures packed")


if __name__ == "__main__":
    main()
