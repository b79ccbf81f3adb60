"""The example programs of examples/robots against a bridge: what they send is what is sent here,
byte for byte."""

from __future__ import annotations

import asyncio
import socket
import threading
from contextlib import contextmanager
from pathlib import Path

import pytest
from dlo_client.bridge.server import bridge
from dlo_client.bridge.settings import BridgeSettings, read

from tests.clients.bridge import programs
from tests.clients.bridge.recipe_service import RecipeService

EXAMPLES = Path(__file__).parents[3] / "examples" / "robots"


@contextmanager
def bridge_in_a_thread(rotation: str, tmp_path: Path, reply: str):
    """Ports of a bridge that runs beside the test."""
    picture = tmp_path / "picture.png"
    picture.write_bytes(b"picture")
    sections = {
        "ascii": {"port": 0, "reply": reply},
        "binary": {"port": 0},
        "picture": {"file": picture},
    }
    started, ports, stop = threading.Event(), {}, {}

    async def serve():
        stop["event"], stop["loop"] = asyncio.Event(), asyncio.get_running_loop()
        settings = BridgeSettings.model_validate(sections)
        async with RecipeService(rotation).client() as client, bridge(settings, client) as found:
            ports.update(found)
            started.set()
            await stop["event"].wait()

    thread = threading.Thread(target=lambda: asyncio.run(serve()), daemon=True)
    thread.start()
    assert started.wait(60)
    try:
        yield ports
    finally:
        stop["loop"].call_soon_threadsafe(stop["event"].set)
        thread.join(60)


@pytest.fixture
def connected(tmp_path):
    @contextmanager
    def connected(protocol: str, rotation: str, reply: str = "plain"):
        sent: list[bytes] = []
        with (
            bridge_in_a_thread(rotation, tmp_path, reply) as ports,
            socket.create_connection(("127.0.0.1", ports[protocol]), timeout=60) as connection,
        ):
            yield (
                lambda data: (sent.append(data), connection.sendall(data)),
                connection.makefile("rb"),
                sent,
            )

    return connected


def test_urscript(connected):
    text = (EXAMPLES / "ur_pick_cable.script").read_text()
    with connected("ascii", "ur", "parentheses") as (send, stream, sent):
        moves = programs.run_urscript(text, send, stream.readline)
    assert sent == [b"H,1\n", b"T,100,7\n", b"R,100,8000\n", b"G,100,2\n", b"T,101,7\n"]
    assert moves[-1] == "[0.25, -0.125, 0.05, 0.0, 3.1, 0.25]"
    assert len(moves) == 3


def test_urscript_stops_when_the_trigger_is_refused(connected):
    text = (EXAMPLES / "ur_pick_cable.script").read_text().replace("T,100,7", "T,100,seven")
    with (
        connected("ascii", "ur", "parentheses") as (send, stream, _),
        pytest.raises(programs.Halted),
    ):
        programs.run_urscript(text, send, stream.readline)


def test_rapid(connected):
    text = (EXAMPLES / "abb_pick_cable.mod").read_text()
    with connected("ascii", "abb") as (send, stream, sent):
        moves = programs.run_rapid(text, send, stream.readline)
    assert sent == [b"T,200,7\r\n", b"R,200,8000\r\n", b"G,200,2\r\n", b"X,200\r\n"]
    assert len(moves) == 2
    assert "[0.25, -0.125, 0.05, 0.0, 3.1, 0.25" in moves[1]


def test_structured_text(connected):
    text = (EXAMPLES / "plc_pick_cable.st").read_text()
    with connected("binary", "kuka_abc") as (send, stream, sent):
        found = programs.run_structured_text(text, send, lambda: stream.read(512))
    assert found["step"] == 10
    assert (found["x"], found["y"], found["z"]) == pytest.approx((0.25, -0.125, 0.05))
    assert [len(frame) for frame in sent] == [64, 64]
    assert sent[0][:10].hex() == "444c00020000012c0007"


def test_the_example_settings_are_valid():
    settings = read(EXAMPLES / "bridge.toml")
    assert settings.ascii.reply == "parentheses"
