"""Average the weights of states of one training: ``python -m models.training.foreground.average
NAME FILE:SHARE …``.

A network that went on training for one kind of picture forgets some of another; the mean of it, of
a state on the way and of the network it began with keeps most of both. NAME, exported before, has
the rest of the shares.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

from models.training.export import register
from models.weights.inference import WEIGHTS, manifest


def averaged(own: Path, others: Mapping[Path, float]) -> onnx.ModelProto:
    """The network ``own`` with the weighted mean of its weights and those of ``others``. Raises
    ValueError when the shares leave nothing for it, or the networks are not of one kind."""
    rest = 1 - sum(others.values())
    if not 0 < rest < 1 or min(others.values()) <= 0:
        raise ValueError("shares are above 0 and sum to less than 1")
    model = onnx.load(own)
    tensors = {file: {t.name: t for t in onnx.load(file).graph.initializer} for file in others}
    for tensor in model.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype != np.float32:
            continue
        mean = rest * values
        for file, share in others.items():
            other = tensors[file].get(tensor.name)
            if other is None or tuple(other.dims) != values.shape:
                raise ValueError(f"{file} is another kind of network: {tensor.name}")
            mean = mean + share * numpy_helper.to_array(other)
        tensor.CopyFrom(numpy_helper.from_array(mean.astype(np.float32), tensor.name))
    return model


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name")
    parser.add_argument("others", nargs="+", metavar="FILE:SHARE")
    args = parser.parse_args(arguments)
    spec = manifest()[args.name]
    others = {
        Path(file): float(share) for file, share in (text.rsplit(":", 1) for text in args.others)
    }
    try:
        model = averaged(WEIGHTS / spec.file, others)
    except ValueError as error:
        parser.error(str(error))
    onnx.save(model, WEIGHTS / spec.file)
    mixed = ", ".join(f"{share:g} {file.stem}" for file, share in others.items())
    training = {
        **spec.training,
        "averaged": f"{1 - sum(others.values()):g} of the last weights, {mixed}",
    }
    register(
        args.name,
        WEIGHTS / spec.file,
        replace(spec, training=training, metrics={}),
        spec.parameters,
    )


if __name__ == "__main__":
    main()
