"""The command of every network: train it, measure it on held-out samples, export it."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import torch

from models.training.export import note_without, publish, refuse_useless
from models.training.fit import AnyFamily, Source, fit
from models.training.log import Log
from models.training.state import Config
from models.weights.inference import manifest


def run(family: AnyFamily, config: Config, source: Source) -> dict[str, float]:
    """Train, measure, export; returns the figures of the held-out samples.

    Raises ValueError for a training that cannot be done and for a network that is not good enough
    to be exported.
    """
    log = Log(source.folder / f"{family.name}.jsonl")
    samples, held_out = family.samples(config, source)
    network = fit(family, config, samples, source.folder / f"{family.name}.pt", log)
    metrics = family.measure(network, held_out, config)
    log(network=family.name, config=asdict(config), metrics=metrics)
    refuse_useless(family.name, metrics, family.least)
    training = {"command": _command(family), "samples": len(samples), **asdict(config)}
    for exported in family.exports(network, samples, config):
        without = family.without(held_out, config)
        log(
            network=exported.name,
            without=without,
            onnx_difference=publish(exported, training, metrics, without),
        )
    return metrics


def compare(family: AnyFamily, config: Config, source: Source) -> None:
    """Note in the manifest what there would be without the shipped networks of the family, on the
    held-out samples."""
    without = family.without(family.samples(config, source)[1], config)
    for name, spec in manifest().items():
        if spec.training.get("command") == _command(family):
            note_without(name, without)
    print(family.name, dict(without))


def _command(family: AnyFamily) -> str:
    return f"python -m models.training {family.name}"


def command(family: AnyFamily, arguments: Sequence[str] | None = None) -> None:
    """The command line of a family: a flag for every setting."""
    parser = argparse.ArgumentParser(
        prog=f"python -m models.training {family.name}", description=__doc__
    )
    parser.add_argument(
        "--state",
        type=Path,
        default=Path("build/train"),
        help="folder; a second start goes on there",
    )
    parser.add_argument(
        "--textures", type=Path, help="a pack of background pictures; without it they are noise"
    )
    for name in family.needs:
        parser.add_argument(
            f"--{name}", type=Path, required=True, help="samples that another command made"
        )
    defaults = asdict(family.config())
    for name, default in defaults.items():
        typed = (
            {"action": argparse.BooleanOptionalAction}
            if isinstance(default, bool)
            else {"type": type(default)}
        )
        parser.add_argument(f"--{name.replace('_', '-')}", default=default, **typed)
    parser.add_argument(
        "--without", action="store_true", help="train nothing: note what there would be without it"
    )
    args = parser.parse_args(arguments)
    torch.set_num_threads(1)
    try:
        config = family.config(**{name: getattr(args, name) for name in defaults})
        places = {name: getattr(args, name) for name in family.needs}
        (compare if args.without else run)(
            family, config, Source(args.state, args.textures, **places)
        )
    except ValueError as error:
        parser.error(str(error))
