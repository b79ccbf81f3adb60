"""Train a foreground network on renders and photographs: ``python -m
models.training.foreground.campaign``.

Every batch mixes scenes of the renderer, cuts of hand-marked photographs at any scale and
photographs without cables, where there are some. Pixels where nobody can tell have no weight,
unless a ``--teacher`` is sure of them. The learning rate warms up, holds, and falls over the last
third of ``--minutes``, summed over all starts on one checkpoint: the averaged weights at the end
are what is exported; a later run goes on from them.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from models.synthesis.scenes import WORKSHOP, SceneParams
from models.synthesis.textures import TexturePool, load_pool
from models.training.foreground.augmentation import Cut, cut_out, recolored
from models.training.foreground.learning import Learning, normalize
from models.training.foreground.networks import NETWORKS, ForegroundNetwork
from models.training.foreground.real_pictures import RealPictures, load_empty, load_labelled
from models.training.foreground.stream import SceneStream
from models.training.foreground.teacher import Teacher
from models.training.foreground.validation import validate
from models.training.state import Config

_DATA = (
    "models.synthesis scenes over permissively licensed textures and photographs, and hand-marked photographs of open "
    "hardware projects (NOTICE names them)"
)
CALIBRATION_BATCHES = 12
"""From which the statistics of a network that begins from an export are taken."""
_FIRST_SCENES = 200
"""That must be there before the first step, or half of the slots: else the first ones are seen over
and over."""


@dataclass(frozen=True)
class CampaignParams:
    """``minutes`` of training by the clock; ``batch`` cuts a step of which ``labelled`` are of
    marked photographs and ``empty`` of photographs without cables, on average; ``rate`` at its
    highest, of the encoder ``encoder_rate`` times that; ``decay`` of the averaged weights;
    ``network`` by its name, its channels divided by ``slim``. ``renderers`` processes hold
    ``slots`` scenes; every render is drawn ``reuse`` times, each time cut anew. ``plain`` is the
    share of the renders that lie on a table as in a laboratory, none of them in the air;
    ``teacher``: a shipped network that is learned from beside the labels; ``hints``: a shipped
    compact one that a DeepLabV3+ learns from and that shows what its encoder sees, too. Raises
    ValueError for settings under which a training would never begin."""

    network: str = "compact"
    slim: int = 1
    teacher: str = ""
    hints: str = ""
    height: int = 256
    width: int = 448
    minutes: float = 130.0
    batch: int = 8
    labelled: float = 1.7
    empty: float = 0.6
    plain: float = 0.0
    rate: float = 1.5e-3
    encoder_rate: float = 1.0
    decay: float = 0.999
    seed: int = 1
    slots: int = 2400
    renderers: int = 1
    reuse: int = 4
    check_every: float = 10.0

    def __post_init__(self) -> None:
        self.config()
        if self.renderers < 1 or self.reuse < 1 or self.minutes <= 0:
            raise ValueError("renderers, reuse and minutes must be above 0")
        needed = 2 * self.renderers + 2  # each renderer may be at work on one of them
        if self.slots < needed:
            raise ValueError(
                f"slots is {self.slots}; with {self.renderers} renderers it takes {needed}"
            )
        if min(self.labelled, self.empty) < 0:
            raise ValueError("labelled and empty are numbers of pictures, not below 0")

    def config(self) -> Config:
        """How the network learns."""
        return Config(
            seed=self.seed,
            minutes=self.minutes,
            batch=self.batch,
            rate=self.rate,
            keep=self.decay,
            weight_decay=0.02,
            clip=5.0,
            warm_up=0.03,
            hold=0.62,
        )


class Streams(NamedTuple):
    """Renders: of ``workshop`` scenes, and ``plain`` ones of a table (the same stream when none are
    wanted)."""

    workshop: SceneStream
    plain: SceneStream

    def filled(self) -> int:
        return min(stream.filled() for stream in self)

    def rendered(self) -> int:
        return sum(stream.rendered.value for stream in set(self))

    def close(self) -> None:
        for stream in set(self):
            stream.close()


class Mixture:
    """Batches of renders of two kinds, labelled photographs and photographs without cables."""

    def __init__(
        self,
        streams: Streams,
        real: RealPictures | None,
        empty: RealPictures | None,
        params: CampaignParams,
    ) -> None:
        self.streams, self.params = streams, params
        self.photographs = [
            (real, params.labelled if real else 0.0),
            (empty, params.empty if empty else 0.0),
        ]
        self.rng = np.random.default_rng(
            [params.seed, time.time_ns() % 2**32]
        )  # other pictures after a restart
        size = params.height, params.width
        self.near = Cut(size, (0.3, 1.3), 0.25)
        self.rendered = Cut(size, (0.7, 1.5), 0.3)

    def batch(self) -> tuple[Tensor, Tensor]:
        """(B, 3, H, W) uint8 pictures and (B, H, W) uint8 labels."""
        pairs = [self._one() for _ in range(self.params.batch)]
        images = np.stack([recolored(image, self.rng).transpose(2, 0, 1) for image, _ in pairs])
        return torch.from_numpy(images), torch.from_numpy(np.stack([labels for _, labels in pairs]))

    def _one(self) -> tuple[np.ndarray, np.ndarray]:
        kind = self.rng.random() * self.params.batch
        for pictures, share in self.photographs:
            if pictures is not None and kind < share:
                return pictures.sample(self.rng, self.near)
            kind -= share
        stream = (
            self.streams.plain if self.rng.random() < self.params.plain else self.streams.workshop
        )
        images, masks = stream.draw(self.rng, 1)
        image = np.ascontiguousarray(images[0].numpy().transpose(1, 2, 0))
        labels = masks[0].numpy() * 255
        if self.rng.random() < 0.3:  # as rendered, sharp to the pixel
            return image, labels
        return cut_out(image, labels, self.rendered, self.rng)


def begin(
    params: CampaignParams,
    folder: Path,
    pretrained: Path | None,
    initial: Path | None,
    batches: Iterator[Tensor],
) -> Learning:
    """From the folder's checkpoint if there is one. Raises ValueError as :meth:`Learning.resume`
    does."""
    teacher = (
        Teacher.shipped(params.teacher, np.random.default_rng(params.seed))
        if params.teacher
        else None
    )
    learning = Learning(
        params.network, params.slim, params.config(), params.encoder_rate, teacher, params.hints
    )
    if not learning.resume(folder / "last.pt"):
        learning.begin(pretrained, initial, batches)
    return learning


def run(
    learning: Learning,
    params: CampaignParams,
    mixture: Mixture,
    folder: Path,
    measure: Callable[[ForegroundNetwork], dict[str, float]],
) -> None:
    """Train until ``minutes`` are over, a checkpoint and a line of ``log.jsonl`` every
    ``check_every``; at the end the checkpoint gets what ``measure`` finds."""
    course = learning.course
    losses: list[float] = []
    checked, last = course.seconds, time.monotonic()
    learning.network.train()
    while course.share() < 1:
        losses.append(learning.step(*mixture.batch()))
        now = time.monotonic()
        course.seconds += now - last
        last = now
        if course.seconds - checked > 60 * params.check_every:
            checked = course.seconds
            _check(learning, params, folder, mixture, losses, {})
            losses = []
    _check(learning, params, folder, mixture, losses, measure(learning.average))


def _check(
    learning: Learning,
    params: CampaignParams,
    folder: Path,
    mixture: Mixture,
    losses: list[float],
    metrics: dict[str, float],
) -> None:
    learning.save(
        folder / "last.pt",
        asdict(params),
        metrics=metrics,
        data=_DATA,
        command="python -m models.training.foreground.campaign",
    )
    line = {
        "step": learning.course.steps,
        "pictures": learning.course.steps * params.batch,
        "minutes": round(learning.course.seconds / 60, 1),
        "loss": round(float(np.mean(losses or [0.0])), 4),
        "rendered": mixture.streams.rendered(),
        **metrics,
    }
    print(json.dumps(line), flush=True)
    with (folder / "log.jsonl").open("a") as file:
        file.write(json.dumps(line) + "\n")


def picture_arguments(parser: argparse.ArgumentParser) -> None:
    """Where a training takes its pictures from: ``textures``, ``photographs``,
    ``empty_pictures``."""
    parser.add_argument("--textures", type=Path, help="pack or folder of backgrounds")
    parser.add_argument(
        "--labelled", dest="photographs", type=Path, help="folder with imgs/ and masks/"
    )
    parser.add_argument("--empty-pictures", type=Path, help="folder of photographs without cables")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m models.training.foreground.campaign", description=__doc__
    )
    parser.add_argument(
        "folder", type=Path, help="checkpoint folder; goes on from last.pt when it is there"
    )
    picture_arguments(parser)
    parser.add_argument(
        "--pretrained", type=Path, help="published ImageNet weights of the encoder to begin from"
    )
    parser.add_argument(
        "--initial",
        type=Path,
        help="exported network, or checkpoint, of the same kind to begin from",
    )
    parser.add_argument(
        "--validate", type=int, default=64, help="rendered pictures to measure on at the end"
    )
    parser.add_argument("--threads", type=int, default=1)
    for name, default in asdict(CampaignParams()).items():
        flag = {"labelled": "labelled-share", "empty": "empty-share"}.get(
            name, name.replace("_", "-")
        )
        choices = list(NETWORKS) if name == "network" else None
        parser.add_argument(
            f"--{flag}", dest=name, type=type(default), default=default, choices=choices
        )
    return parser


@contextmanager
def mixed(
    params: CampaignParams, pool: TexturePool, labelled: Path | None, empty: Path | None
) -> Iterator[Mixture]:
    """Batches, once the first scenes are rendered: over the textures of ``pool``, with photographs
    of the folders ``labelled`` and ``empty``."""
    size, seed = (params.height, params.width), int(time.time())
    photographs = load_labelled(labelled) if labelled else None
    without = load_empty(empty) if empty else None

    def stream(kind: SceneParams, first: int) -> SceneStream:
        return SceneStream(
            kind,
            pool,
            seed=first,
            slots=params.slots,
            renderers=params.renderers,
            reuse=params.reuse,
        )

    workshop = stream(replace(WORKSHOP, size=size), seed)
    plain = (
        stream(SceneParams(size, width_share=(0.006, 0.12)), seed + 1) if params.plain else workshop
    )
    streams = Streams(workshop, plain)
    try:
        while streams.filled() < min(_FIRST_SCENES, params.slots // 2):
            time.sleep(0.5)
        yield Mixture(streams, photographs, without, params)
    finally:
        streams.close()


def _train(args: argparse.Namespace, params: CampaignParams) -> None:
    args.folder.mkdir(parents=True, exist_ok=True)
    scenes, sheet = (
        replace(WORKSHOP, size=(params.height, params.width)),
        args.folder / "validation.png",
    )
    pool = load_pool(args.textures)
    with mixed(params, pool, args.photographs, args.empty_pictures) as mixture:
        batches = (normalize(mixture.batch()[0]) for _ in range(CALIBRATION_BATCHES))
        learning = begin(params, args.folder, args.pretrained, args.initial, batches)
        run(
            learning,
            params,
            mixture,
            args.folder,
            lambda net: validate(net, sheet, pool, scenes, args.validate),
        )


def main() -> None:
    parser = _parser()
    args = parser.parse_args()
    torch.set_num_threads(args.threads)
    try:
        _train(
            args, CampaignParams(**{name: getattr(args, name) for name in asdict(CampaignParams())})
        )
    except ValueError as error:
        parser.error(str(error))


if __name__ == "__main__":
    main()
