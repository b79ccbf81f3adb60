"""The pool of background pictures: a folder of images, packed once into one file, or none at
all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor

LONGEST_PX = 480


@dataclass(frozen=True)
class TexturePool:
    """``groups``: per folder a list of (h, w, 3) uint8 pictures. Each group is drawn with equal
    chance, so that a thousand small material tiles do not drown thirty photographs."""

    groups: tuple[tuple[NDArray[np.uint8], ...], ...]

    def sample(
        self, rng: np.random.Generator, size: tuple[int, int], device: torch.device
    ) -> Tensor:
        """A random cut of a random picture, tiled (mirrored) when too small: (3, height, width) 0
        to 1."""
        if not self.groups:
            return procedural(rng, size, device)
        group = self.groups[rng.integers(len(self.groups))]
        picture = torch.as_tensor(group[rng.integers(len(group))], device=device)
        image = picture.permute(2, 0, 1).float()[None] / 255.0
        return _cut(_mirrored(image, rng), rng, size)


def load_pool(path: Path | None) -> TexturePool:
    """From a pack (``.npz``), a folder with one sub-folder a group, or ``None``: procedural
    only."""
    if path is None:
        return TexturePool(())
    if path.suffix == ".npz":
        with np.load(path) as pack:
            names = sorted(pack.files)
            groups: dict[str, list[NDArray[np.uint8]]] = {}
            for name in names:
                groups.setdefault(name.split("/")[0], []).append(pack[name])
        return TexturePool(tuple(tuple(g) for g in groups.values()))
    return TexturePool(tuple(tuple(images) for images in _read_folder(path).values()))


def pack(
    folder: Path, target: Path, extra: dict[str, list[NDArray[np.uint8]]] | None = None
) -> int:
    """Write every picture of ``folder/<group>/``, and the groups of ``extra``, into one ``.npz``;
    returns how many."""
    groups = _read_folder(folder) | (extra or {})
    arrays = {
        f"{g}/{i:05d}": image for g, images in groups.items() for i, image in enumerate(images)
    }
    np.savez(target, **arrays)  # type: ignore[arg-type]
    return len(arrays)


def procedural(rng: np.random.Generator, size: tuple[int, int], device: torch.device) -> Tensor:
    """Colored noise over a plain color: (3, height, width)."""
    base = torch.as_tensor(rng.uniform(0.05, 0.95, 3).astype(np.float32), device=device)[
        :, None, None
    ]
    image = base.expand(3, *size).clone()
    for cells in (4, 16, 64):
        noise = rng.normal(0.0, rng.uniform(0.0, 0.12), (1, 3, cells, cells)).astype(np.float32)
        image += F.interpolate(torch.as_tensor(noise, device=device), size, mode="bilinear")[0]
    return image.clamp(0, 1)


def _read_folder(folder: Path) -> dict[str, list[NDArray[np.uint8]]]:
    import cv2  # packing needs a decoder, training from a pack does not

    groups: dict[str, list[NDArray[np.uint8]]] = {}
    for file in sorted(folder.glob("*/*")):
        image = cv2.imread(str(file), cv2.IMREAD_COLOR)
        if image is None:
            continue
        scale = min(1.0, LONGEST_PX / max(image.shape))
        image = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        groups.setdefault(file.parent.name, []).append(np.ascontiguousarray(image[:, :, ::-1]))
    if not groups:
        raise ValueError(f"no pictures in the sub-folders of {folder}")
    return groups


def _mirrored(image: Tensor, rng: np.random.Generator) -> Tensor:
    if rng.random() < 0.5:
        image = image.flip(3)
    if rng.random() < 0.3:
        image = image.transpose(2, 3)
    if image.shape[3] < 200:
        image = torch.cat([image, image.flip(3)], 3)
        image = torch.cat([image, image.flip(2)], 2)
    return image


def _cut(image: Tensor, rng: np.random.Generator, size: tuple[int, int]) -> Tensor:
    height, width = size
    small = image.shape[3] <= 260
    zoom = rng.uniform(1.0, 3.5) if small else rng.uniform(1.0, 2.2)
    reach = min(width / zoom / image.shape[3], 4.0 if small else 1.0)
    angle = rng.uniform(-np.pi, np.pi) if small else rng.normal(0.0, 0.15)
    cos, sin = np.cos(angle) * reach, np.sin(angle) * reach
    aspect = height / width
    ratio = image.shape[3] / image.shape[2]
    room = 0.0 if small else max(1 - reach, 0.0)
    # Corner to corner -1 to 1, as grid_sample counts; a plain sum is faster than affine_grid.
    x = torch.linspace(-1 + 1 / width, 1 - 1 / width, width, device=image.device)[None]
    y = torch.linspace(-1 + 1 / height, 1 - 1 / height, height, device=image.device)[:, None]
    u = float(cos) * x - float(sin * aspect) * y + rng.uniform(-room, room)
    v = float(sin * ratio) * x + float(cos * aspect * ratio) * y + rng.uniform(-room, room)
    grid = torch.stack([u, v], 2)[None]
    return F.grid_sample(
        image, grid, mode="bilinear", padding_mode="reflection", align_corners=False
    )[0]
