"""A small stand-in for rclpy and the message packages: what the node uses, with their names and
rules.

A lifecycle publisher publishes only between activate and deactivate; messages have the fields of
their definitions and refuse others, as the generated classes do.
"""

from __future__ import annotations

import copy
import sys
from enum import Enum
from types import ModuleType, SimpleNamespace
from typing import Any, ClassVar


def message(name: str, **defaults: Any) -> type:
    """A class with these fields."""

    class Message:
        __slots__ = tuple(defaults)

        def __init__(self, **given: Any) -> None:
            for field, value in (copy.deepcopy(defaults) | given).items():
                setattr(self, field, value)

    Message.__name__ = name
    return Message


Time = message("Time", sec=0, nanosec=0)
Header = message("Header", stamp=Time(), frame_id="")
Image = message(
    "Image", header=Header(), height=0, width=0, encoding="", is_bigendian=0, step=0, data=b""
)
CameraInfo = message(
    "CameraInfo", header=Header(), height=0, width=0, k=[0.0] * 9, d=[], distortion_model=""
)
String = message("String", data="")
ColorRGBA = message("ColorRGBA", r=0.0, g=0.0, b=0.0, a=0.0)
Point = message("Point", x=0.0, y=0.0, z=0.0)
_Quaternion = message("Quaternion", x=0.0, y=0.0, z=0.0, w=0.0)
_Pose = message("Pose", position=Point(), orientation=_Quaternion())
_Vector = message("Vector3", x=0.0, y=0.0, z=0.0)


class Marker(
    message(
        "Marker",
        header=Header(),
        ns="",
        id=0,
        type=0,
        action=0,
        pose=_Pose(),
        scale=_Vector(),
        color=ColorRGBA(),
        points=[],
    )
):
    __slots__ = ()
    LINE_STRIP, ADD, DELETEALL = 4, 0, 3


MarkerArray = message("MarkerArray", markers=[])


class Trigger:
    Request = message("Request")
    Response = message("Response", success=False, message="")


class TransitionCallbackReturn(Enum):
    SUCCESS, FAILURE, ERROR = range(3)


class Publisher:
    """Keeps what is published while it is active."""

    def __init__(self, kind: type, topic: str) -> None:
        self.kind, self.topic, self.active, self.sent = kind, topic, False, []

    def publish(self, sent: Any) -> None:
        assert isinstance(sent, self.kind), f"{type(sent)} on {self.topic}"
        if self.active:
            self.sent.append(sent)


class LifecycleNode:
    """Transitions as lifecycle_msgs numbers the states; entities by topic."""

    made: ClassVar[list[LifecycleNode]] = []

    def __init__(self, name: str) -> None:
        self.name, self.state = name, "unconfigured"
        self.parameters: dict[str, Any] = {}
        self.publishers: dict[str, Publisher] = {}
        self.subscribed: dict[str, Any] = {}
        self.offered: dict[str, Any] = {}
        self.logged: list[str] = []
        LifecycleNode.made.append(self)

    def declare_parameter(self, name: str, value: Any) -> None:
        self.parameters.setdefault(name, value)

    def get_parameter(self, name: str) -> Any:
        return SimpleNamespace(value=self.parameters[name])

    def get_logger(self) -> Any:
        return SimpleNamespace(
            error=self.logged.append, warning=self.logged.append, info=self.logged.append
        )

    def create_lifecycle_publisher(self, kind: type, topic: str, _qos: Any) -> Publisher:
        return self.publishers.setdefault(topic, Publisher(kind, topic))

    def create_subscription(self, kind: type, topic: str, callback: Any, _qos: Any) -> str:
        self.subscribed[topic] = callback
        return topic

    def create_service(self, kind: type, name: str, callback: Any) -> str:
        self.offered[name] = callback
        return name

    def destroy_subscription(self, topic: str) -> None:
        del self.subscribed[topic]

    def destroy_service(self, name: str) -> None:
        del self.offered[name]

    def destroy_publisher(self, publisher: Publisher) -> None:
        del self.publishers[publisher.topic]

    def on_activate(self, _state: Any) -> TransitionCallbackReturn:
        for publisher in self.publishers.values():
            publisher.active = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, _state: Any) -> TransitionCallbackReturn:
        for publisher in self.publishers.values():
            publisher.active = False
        return TransitionCallbackReturn.SUCCESS

    def change(self, transition: str) -> TransitionCallbackReturn:
        """As ``ros2 lifecycle set`` does it."""
        before, after = {
            "configure": ("unconfigured", "inactive"),
            "activate": ("inactive", "active"),
            "deactivate": ("active", "inactive"),
            "cleanup": ("inactive", "unconfigured"),
        }[transition]
        assert self.state == before, f"{transition} in {self.state}"
        outcome = getattr(self, f"on_{transition}")(SimpleNamespace(label=before))
        if outcome is TransitionCallbackReturn.SUCCESS:
            self.state = after
        return outcome


def modules() -> dict[str, ModuleType]:
    """By the names under which the node imports them."""
    contents = {
        "rclpy": {"init": None, "spin": None, "try_shutdown": None},
        "rclpy.lifecycle": {
            "LifecycleNode": LifecycleNode,
            "State": SimpleNamespace,
            "TransitionCallbackReturn": TransitionCallbackReturn,
        },
        "rclpy.qos": {"qos_profile_sensor_data": "sensor data"},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"Image": Image, "CameraInfo": CameraInfo},
        "std_msgs": {},
        "std_msgs.msg": {"String": String, "ColorRGBA": ColorRGBA},
        "std_srvs": {},
        "std_srvs.srv": {"Trigger": Trigger},
        "geometry_msgs": {},
        "geometry_msgs.msg": {"Point": Point},
        "visualization_msgs": {},
        "visualization_msgs.msg": {"Marker": Marker, "MarkerArray": MarkerArray},
    }
    made = {}
    for name, fields in contents.items():
        made[name] = ModuleType(name)
        vars(made[name]).update(fields)
    return made


def install(monkeypatch: Any) -> None:
    """For the duration of a test."""
    for name, module in modules().items():
        monkeypatch.setitem(sys.modules, name, module)
