"""Networks of a few numbers, as files: one convolution, so that a test knows what they answer."""

from __future__ import annotations

import hashlib
from datetime import UTC, datetime

import numpy as np
import onnx
from dlo_client.contracts.networks import NetworkCard, Preprocess
from onnx import TensorProto, helper, numpy_helper

from workers.networks.package import pack

FED = Preprocess(
    long_side=640,
    multiple=32,
    mean=(0, 0, 0),
    std=(1, 1, 1),
    threshold=0.5,
    certainty=0.0,
    least_area=0.0,
)


def brightness(
    gain: float = 20.0, *, inputs: int = 3, outputs: int = 1, sides: tuple = ("h", "w")
) -> bytes:
    """An ONNX file: log odds ``gain`` × (mean of the channels - 0.5), so what is bright is
    cable."""
    weight = np.full((outputs, inputs, 1, 1), gain / inputs, np.float32)
    bias = np.full(outputs, -gain / 2, np.float32)
    shape = (1, inputs, *sides)
    graph = helper.make_graph(
        [helper.make_node("Conv", ["input", "weight", "bias"], ["output"])],
        "brightness",
        [helper.make_tensor_value_info("input", TensorProto.FLOAT, shape)],
        [helper.make_tensor_value_info("output", TensorProto.FLOAT, (1, outputs, *sides))],
        [numpy_helper.from_array(weight, "weight"), numpy_helper.from_array(bias, "bias")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    written: bytes = model.SerializeToString()
    return written


def with_outside_weights(place: str) -> bytes:
    """One whose weights are to be read from a file of the machine."""
    model = onnx.load_from_string(brightness())
    tensor = model.graph.initializer[0]
    tensor.ClearField("raw_data")
    tensor.data_location = TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value=place)
    written: bytes = model.SerializeToString()
    return written


def card(data: bytes, name: str = "cell7", **more: object) -> NetworkCard:
    values: dict[str, object] = {
        "name": name,
        "architecture": "unknown",
        "sha256": hashlib.sha256(data).hexdigest(),
        "parameters": 4,
        "origin": "made for a test",
        "preprocess": FED,
        "created_at": datetime(2026, 11, 28, tzinfo=UTC),
    }
    return NetworkCard.model_validate(values | more)


def packed(data: bytes | None = None, name: str = "cell7", **more: object) -> bytes:
    """The file of a network."""
    data = brightness() if data is None else data
    return pack(card(data, name, **more), data)
