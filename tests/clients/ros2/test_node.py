"""The ROS 2 node against a stand-in for rclpy: lifecycle, topics, services, encodings."""

from __future__ import annotations

import importlib
import json
import sys
import threading
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
import yaml
from dlo_client import FrameResult, InstancesRequest, TopologyRequest, TrackedCable
from dlo_client.errors import ConnectionFailed

from tests.clients import samples
from tests.clients.ros2 import standin
from tests.processes import wait_until

PACKAGE = Path(__file__).parents[3] / "clients" / "ros2" / "dlo_ros2"


class Service:
    """Answers with two cables; ``gate`` closed keeps an answer back."""

    def __init__(self) -> None:
        self.asked: list = []
        self.gate = threading.Event()
        self.gate.set()
        self.away = self.closed = False
        self.tracks: list[Track] = []

    def run(self, request, picture):
        self.asked.append((request, picture))
        self.gate.wait(60)
        if self.away:
            raise ConnectionFailed("nobody answers")
        return samples.two_cables()

    def track(self, options):
        self.tracks.append(Track(self, options))
        return self.tracks[-1]

    def close(self) -> None:
        self.closed = True


class Track:
    """Two cables, of which the second is lost; ids 4 and 9."""

    def __init__(self, service: Service, options) -> None:
        self.service, self.options, self.times, self.ended = service, options, [], False

    def frame(self, picture, time_s):
        if self.service.away:
            raise ConnectionFailed("nobody answers")
        self.times.append(time_s)
        first, second = samples.two_cables().instances
        cables = [
            TrackedCable(
                id=number,
                state=state,
                certainty=0.9,
                centerline_xy=one.centerline_xy,
                length_px=90.0,
                width_px=6.0,
                start_px=0.0,
                covered=[],
                endpoints=[],
                score=0.9,
            )
            for number, state, one in ((4, "seen", first), (9, "lost", second))
        ]
        return FrameResult.model_construct(
            frame=len(self.times), width=3, height=2, cables=cables, crossings=[]
        )

    def end(self) -> None:
        self.ended = True


@pytest.fixture
def ros(monkeypatch):
    """The package's modules, with the stand-in in place of ROS."""
    standin.install(monkeypatch)
    monkeypatch.syspath_prepend(str(PACKAGE))
    for name in [name for name in sys.modules if name.startswith("dlo_ros2")]:
        monkeypatch.delitem(sys.modules, name)
    node = importlib.import_module("dlo_ros2.node")
    yield node, importlib.import_module("dlo_ros2.conversion")
    for name in [name for name in sys.modules if name.startswith("dlo_ros2")]:
        monkeypatch.delitem(sys.modules, name)


@pytest.fixture
def service() -> Service:
    return Service()


@pytest.fixture
def node(ros, service):
    made = ros[0].DloNode(open_client=lambda url, key: service)
    yield made
    if made.state == "active":
        made.change("deactivate")


def image(number: int = 1) -> standin.Image:
    made = standin.Image(height=2, width=3, encoding="bgr8", step=12)
    made.data = bytes(range(12)) + bytes(range(20, 32))
    made.header = standin.Header(stamp=standin.Time(sec=number, nanosec=5), frame_id="camera")
    return made


def activate(node) -> None:
    node.change("configure")
    node.change("activate")


def test_an_image_becomes_result_markers_and_labels(node, service):
    activate(node)
    node.subscribed["image"](image(7))
    results = node.publishers["~/result"].sent
    wait_until(lambda: node.publishers["~/labels"].sent, 10)
    content = json.loads(results[0].data)
    assert content["stamp"] == {"sec": 7, "nanosec": 5}
    assert content["frame_id"] == "camera"
    scene = samples.two_cables()
    assert len(content["result"]["instances"]) == len(scene.instances)
    clear, *lines = node.publishers["~/markers"].sent[0].markers
    assert clear.action == standin.Marker.DELETEALL
    assert [len(line.points) for line in lines] == [len(i.centerline_xy) for i in scene.instances]
    x, y = scene.instances[0].centerline_xy[0]
    assert (lines[0].points[0].x, lines[0].points[0].y) == pytest.approx((x * 0.001, y * 0.001))
    labels = node.publishers["~/labels"].sent[0]
    ids = np.frombuffer(labels.data, np.uint16).reshape(labels.height, labels.width)
    assert (ids == 1).sum() == scene.instances[0].mask_rle.array().sum()


def test_the_newest_image_counts(node, service):
    activate(node)
    service.gate.clear()
    node.subscribed["image"](image(1))
    wait_until(lambda: service.asked, 10)
    for number in (2, 3, 4):
        node.subscribed["image"](image(number))
    service.gate.set()
    results = node.publishers["~/result"].sent
    wait_until(lambda: len(results) == 2, 10)
    assert [json.loads(one.data)["stamp"]["sec"] for one in results] == [1, 4]


def test_services_run_jobs_on_the_newest_image(node, service):
    node.parameters["only_on_request"] = True
    activate(node)
    ask = node.offered["~/topology"]
    assert not ask(None, standin.Trigger.Response()).success
    node.subscribed["image"](image())
    assert service.asked == []
    assert ask(None, standin.Trigger.Response()).success
    wait_until(lambda: service.asked, 10)
    assert isinstance(service.asked[0][0], TopologyRequest)


def test_a_tracked_cable_keeps_its_id(node, service):
    node.parameters |= {"kind": "track", "effort": "fast"}
    activate(node)
    results = node.publishers["~/result"].sent
    for number in (1, 2):
        node.subscribed["image"](image(number))
        wait_until(lambda number=number: len(results) == number, 10)
    (track,) = service.tracks
    assert track.options.effort == "fast"
    assert track.times == pytest.approx([1.0, 2.0], abs=1e-6)
    assert [c["id"] for c in json.loads(results[1].data)["result"]["cables"]] == [4, 9]
    wait_until(lambda: len(node.publishers["~/markers"].sent) == 2, 10)
    _, *lines = node.publishers["~/markers"].sent[1].markers
    assert [(line.ns, line.id) for line in lines] == [("cables", 4)]
    node.change("deactivate")
    assert track.ended


def test_a_track_that_failed_is_begun_anew(node, service):
    node.parameters["kind"] = "track"
    activate(node)
    service.away = True
    node.subscribed["image"](image(1))
    wait_until(lambda: node.logged, 10)
    service.away = False
    node.subscribed["image"](image(2))
    wait_until(lambda: node.publishers["~/result"].sent, 10)
    assert [track.ended for track in service.tracks] == [True, False]


def test_nothing_is_looked_at_while_inactive(node, service):
    node.change("configure")
    node.subscribed["image"](image())
    assert not node.offered["~/instances"](None, standin.Trigger.Response()).success
    assert service.asked == []
    node.change("activate")
    node.change("deactivate")
    node.change("cleanup")
    assert service.closed
    assert node.subscribed == node.offered == node.publishers == {}
    activate(node)


def test_a_service_that_is_away_is_logged_and_the_node_goes_on(node, service):
    activate(node)
    service.away = True
    node.subscribed["image"](image())
    wait_until(lambda: node.logged, 10)
    assert "nobody answers" in node.logged[0]
    service.away = False
    node.subscribed["image"](image(2))
    wait_until(lambda: node.publishers["~/result"].sent, 10)


def test_a_kind_that_is_none_does_not_configure(node):
    node.parameters["kind"] = "everything"
    assert node.change("configure") is standin.TransitionCallbackReturn.FAILURE
    assert node.state == "unconfigured"


@pytest.mark.parametrize(
    ("encoding", "data", "step", "expected"),
    [
        ("bgr8", bytes([1, 2, 3, 4, 5, 6, 0, 0]), 8, [[[3, 2, 1], [6, 5, 4]]]),
        ("rgb8", bytes([1, 2, 3, 4, 5, 6]), 6, [[[1, 2, 3], [4, 5, 6]]]),
        ("bgra8", bytes(range(8)), 8, [[[2, 1, 0, 3], [6, 5, 4, 7]]]),
        ("mono8", bytes([9, 8]), 2, [[9, 8]]),
        ("mono16", bytes([1, 0, 0, 1]), 4, [[1, 256]]),
    ],
)
def test_encodings(ros, encoding, data, step, expected):
    message = standin.Image(height=1, width=2, encoding=encoding, step=step, data=data)
    assert ros[1].array_of(message).tolist() == expected


def test_another_byte_order_and_another_encoding(ros):
    swapped = standin.Image(
        height=1, width=1, encoding="mono16", step=2, data=bytes([1, 0]), is_bigendian=1
    )
    assert ros[1].array_of(swapped).tolist() == [[256]]
    with pytest.raises(ros[1].UnknownEncodingError, match="yuv422"):
        ros[1].array_of(standin.Image(encoding="yuv422"))


def test_the_package_names_what_it_uses(ros):
    needed = {
        one.text for one in ElementTree.parse(PACKAGE / "package.xml").getroot().iter("exec_depend")
    }
    assert {
        "rclpy",
        "sensor_msgs",
        "std_msgs",
        "std_srvs",
        "geometry_msgs",
        "visualization_msgs",
    } <= needed
    parameters = yaml.safe_load((PACKAGE / "config" / "dlo.yaml").read_text())["dlo"][
        "ros__parameters"
    ]
    assert set(parameters) <= set(ros[0].PARAMETERS)
    assert set(ros[0].REQUESTS) == {"instances", "topology", "plan_disentangle"}
    assert isinstance(ros[0].REQUESTS["instances"]("fast"), InstancesRequest)
    compile((PACKAGE / "launch" / "dlo.launch.py").read_text(), "dlo.launch.py", "exec")
