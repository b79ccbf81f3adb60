"""The lifecycle node: images in; centerlines, masks and plans out; services for the jobs.

Subscribes ``image`` (sensor_msgs/Image) and ``camera_info``. Publishes ``~/result``
(std_msgs/String: the result's JSON with the image's stamp), ``~/markers``
(visualization_msgs/MarkerArray), ``~/labels`` (sensor_msgs/Image, ids of instances). Services
``~/instances``, ``~/topology``, ``~/plan_disentangle`` (std_srvs/Trigger) run on the newest image.
With the ``kind`` ``track`` every image is the next frame of a track: cables keep their ids, and so
do their markers.

Strategy: a thread does the waiting for the service, so that the executor is never held up. It takes
the newest image; those that came meanwhile are passed over. Configure opens the client, activate
lets images through, deactivate stops them, cleanup closes the client.
"""

from __future__ import annotations

import json
import threading
from typing import Any

import rclpy
from dlo_client import (
    Client,
    DisentangleRequest,
    DLOError,
    InstancesRequest,
    InstancesResult,
    TopologyRequest,
    TrackOptions,
)
from rclpy.lifecycle import LifecycleNode, State, TransitionCallbackReturn
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from dlo_ros2.conversion import UnknownEncodingError, array_of, label_image, markers

REQUESTS: dict[str, Any] = {
    "instances": lambda effort: InstancesRequest(effort=effort, files=[]),
    "topology": lambda effort: TopologyRequest(effort=effort, files=[]),
    "plan_disentangle": lambda effort: DisentangleRequest(effort=effort, files=[]),
}
TRACK = "track"
PARAMETERS: dict[str, Any] = {
    "url": "http://127.0.0.1:8000",
    "api_key": "",
    "kind": "instances",
    "effort": "normal",
    "m_per_px": 0.001,
    "only_on_request": False,
}


class DloNode(LifecycleNode):
    """See the module. ``open_client`` makes the client of an address and a key; tests give
    another."""

    def __init__(self, open_client: Any = Client) -> None:
        super().__init__("dlo")
        for name, value in PARAMETERS.items():
            self.declare_parameter(name, value)
        self._open_client = open_client
        self._client: Any = None
        self._track: Any = None
        self._active = False
        self._camera: Any = None
        self._newest: Any = None
        self._waiting: tuple[str, Any] | None = None
        self._wake = threading.Condition()
        self._thread: threading.Thread | None = None

    def on_configure(self, state: State) -> TransitionCallbackReturn:
        """Open the client, make publishers, subscriptions and services. Fails for a ``kind`` that
        is none."""
        if self._parameter("kind") not in (*REQUESTS, TRACK):
            self.get_logger().error(
                f"kind is one of {', '.join(REQUESTS)}, {TRACK}, not {self._parameter('kind')!r}"
            )
            return TransitionCallbackReturn.FAILURE
        try:
            self._client = self._open_client(
                self._parameter("url"), self._parameter("api_key") or None
            )
        except DLOError as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self._results = self.create_lifecycle_publisher(String, "~/result", 10)
        self._markers = self.create_lifecycle_publisher(MarkerArray, "~/markers", 10)
        self._labels = self.create_lifecycle_publisher(Image, "~/labels", 2)
        self._subscriptions = [
            self.create_subscription(Image, "image", self._on_image, qos_profile_sensor_data),
            self.create_subscription(
                CameraInfo, "camera_info", self._on_camera, qos_profile_sensor_data
            ),
        ]
        self._services = [
            self.create_service(Trigger, f"~/{kind}", self._service_of(kind)) for kind in REQUESTS
        ]
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: State) -> TransitionCallbackReturn:
        self._active = True
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()
        return super().on_activate(state)

    def on_deactivate(self, state: State) -> TransitionCallbackReturn:
        self._stop()
        return super().on_deactivate(state)

    def on_cleanup(self, state: State) -> TransitionCallbackReturn:
        """Back to what it was before configure."""
        self._stop()
        for subscription in self._subscriptions:
            self.destroy_subscription(subscription)
        for service in self._services:
            self.destroy_service(service)
        for publisher in (self._results, self._markers, self._labels):
            self.destroy_publisher(publisher)
        self._client.close()
        self._client = self._newest = self._camera = None
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: State) -> TransitionCallbackReturn:
        self._stop()
        if self._client is not None:
            self._client.close()
        return TransitionCallbackReturn.SUCCESS

    def _on_camera(self, message: Any) -> None:
        self._camera = message

    def _on_image(self, message: Any) -> None:
        self._newest = message
        if self._active and not self._parameter("only_on_request"):
            self._hand_over(self._parameter("kind"), message)

    def _service_of(self, kind: str) -> Any:
        def serve(_: Any, response: Any) -> Any:
            """Accepted at once; the answer is published."""
            response.success = self._active and self._newest is not None
            response.message = (
                "published on ~/result" if response.success else "not active, or no image yet"
            )
            if response.success:
                self._hand_over(kind, self._newest)
            return response

        return serve

    def _hand_over(self, kind: str, message: Any) -> None:
        with self._wake:
            self._waiting = (kind, message)
            self._wake.notify()

    def _stop(self) -> None:
        with self._wake:
            self._active = False
            self._wake.notify()
        if self._thread is not None:
            self._thread.join(60)
            self._thread = None
        self._end_track()

    def _work(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting is not None or not self._active)
                if not self._active:
                    return
                assert self._waiting is not None
                (kind, message), self._waiting = self._waiting, None
            self._run(kind, message)

    def _run(self, kind: str, message: Any) -> None:
        try:
            result = self._result_of(kind, message)
        except (DLOError, UnknownEncodingError) as error:
            self.get_logger().warning(f"{kind}: {error}")
            if (
                kind == TRACK
            ):  # forgotten there, or frames are missing: the next image begins another one
                self._end_track()
            return
        stamp = message.header.stamp
        content = {
            "stamp": {"sec": stamp.sec, "nanosec": stamp.nanosec},
            "frame_id": message.header.frame_id,
            "result": result.model_dump(mode="json"),
        }
        self._results.publish(String(data=json.dumps(content)))
        self._markers.publish(markers(result, message.header, self._parameter("m_per_px")))
        if isinstance(result, InstancesResult):
            self._labels.publish(label_image(result, message.header))

    def _result_of(self, kind: str, message: Any) -> Any:
        picture, effort = array_of(message), self._parameter("effort")
        if kind != TRACK:
            return self._client.run(REQUESTS[kind](effort), picture)
        if self._track is None:
            self._track = self._client.track(TrackOptions(effort=effort))
        stamp = message.header.stamp
        return self._track.frame(picture, time_s=stamp.sec + 1e-9 * stamp.nanosec)

    def _end_track(self) -> None:
        ended, self._track = self._track, None
        if ended is None:
            return
        try:
            ended.end()
        except DLOError as error:
            self.get_logger().warning(f"{TRACK}: {error}")

    def _parameter(self, name: str) -> Any:
        return self.get_parameter(name).value


def main() -> None:
    """The entry point ``dlo_node``."""
    rclpy.init()
    node = DloNode()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
