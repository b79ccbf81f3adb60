"""ROS images to arrays and back, and results to messages and markers."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from dlo_client import DisentangleResult, FrameResult, InstancesResult, TopologyResult
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

_CHANNELS = {
    "rgb8": 3,
    "bgr8": 3,
    "rgba8": 4,
    "bgra8": 4,
    "mono8": 1,
    "8UC1": 1,
    "8UC3": 3,
    "mono16": 1,
    "16UC1": 1,
}
_SIXTEEN = ("mono16", "16UC1")
_BLUE_FIRST = ("bgr8", "bgra8", "8UC3")
_COLORS = ((0.9, 0.45, 0.0), (0.0, 0.6, 0.85), (0.15, 0.7, 0.3), (0.8, 0.2, 0.6), (0.95, 0.8, 0.1))


class UnknownEncodingError(ValueError):
    """An image in an encoding that is not read."""


def array_of(image: Any) -> NDArray[Any]:
    """(H, W) or (H, W, C), RGB order, of a ``sensor_msgs/Image``. Raises UnknownEncodingError."""
    channels = _CHANNELS.get(image.encoding)
    if channels is None:
        known = ", ".join(_CHANNELS)
        raise UnknownEncodingError(
            f"images in {image.encoding} are not read; republish as one of {known}"
        )
    kind = np.dtype(np.uint16 if image.encoding in _SIXTEEN else np.uint8)
    if image.encoding in _SIXTEEN:
        kind = kind.newbyteorder(">" if image.is_bigendian else "<")
    rows = np.frombuffer(bytes(image.data), np.uint8).reshape(image.height, image.step)
    used = np.ascontiguousarray(rows[:, : image.width * channels * kind.itemsize])
    pixels = used.view(kind).reshape(image.height, image.width, channels)
    if image.encoding in _BLUE_FIRST:
        pixels = pixels[:, :, [2, 1, 0, 3][:channels]]
    return pixels[:, :, 0] if channels == 1 else pixels


def label_image(result: InstancesResult, header: Any) -> Image:
    """``mono16`` (H, W): the id of the instance that owns a pixel, 0 for none."""
    labels = np.zeros((result.height, result.width), np.uint16)
    for instance in result.instances:
        labels[instance.mask_rle.array()] = instance.id
    image = Image()
    image.header, image.encoding = header, "mono16"
    image.height, image.width, image.step = result.height, result.width, 2 * result.width
    image.is_bigendian = int(sys.byteorder == "big")
    image.data = labels.tobytes()
    return image


def markers(result: Any, header: Any, m_per_px: float) -> MarkerArray:
    """Lines of a result in the image's frame: x right, y down, ``m_per_px`` meters a pixel, z = 0;
    the old ones go. A line has the id of what it shows: a tracked cable keeps its number and color.
    One that is lost has no line."""
    array = MarkerArray()
    clear = _marker(header, 0, "all")
    clear.action = Marker.DELETEALL
    array.markers = [clear]
    for name, number, line in _lines(result):
        one = _marker(header, number, name)
        one.type, one.action = Marker.LINE_STRIP, Marker.ADD
        one.scale.x = 3.0 * m_per_px
        one.color = ColorRGBA(
            r=_COLORS[number % 5][0], g=_COLORS[number % 5][1], b=_COLORS[number % 5][2], a=1.0
        )
        one.points = [Point(x=x * m_per_px, y=y * m_per_px, z=0.0) for x, y in line]
        array.markers.append(one)
    return array


def _lines(result: Any) -> Iterator[tuple[str, int, Sequence[tuple[float, float]]]]:
    match result:
        case InstancesResult():
            yield from (
                ("centerlines", instance.id, instance.centerline_xy)
                for instance in result.instances
            )
        case TopologyResult():
            yield from (("sections", section.id, section.points_xy) for section in result.sections)
        case DisentangleResult():
            yield from (("plan", 1, action.trajectory_xy) for action in result.actions[:1])
        case FrameResult():
            yield from (
                ("cables", c.id, c.centerline_xy) for c in result.cables if c.state != "lost"
            )


def _marker(header: Any, number: int, name: str) -> Marker:
    marker = Marker()
    marker.header, marker.ns, marker.id = header, name, number
    marker.pose.orientation.w = 1.0
    return marker
