"""The bridge over real sockets: both protocols, pipelining, every status that a controller can
meet."""

from __future__ import annotations

import asyncio
import os
import struct
from contextlib import asynccontextmanager

import pytest
from dlo_client.bridge.server import bridge
from dlo_client.bridge.settings import BridgeSettings, read
from dlo_client.errors import InvalidArgument

from tests.clients.bridge.recipe_service import POSES, RecipeService

BOTH = {"ascii": {"port": 0}, "binary": {"port": 0}}


@pytest.fixture
def picture(tmp_path):
    file = tmp_path / "picture.png"
    file.write_bytes(b"picture 1")
    return file


@asynccontextmanager
async def running(file, service=None, **sections):
    """A bridge and its ports."""
    service = service or RecipeService()
    settings = BridgeSettings.model_validate(BOTH | {"picture": {"file": file}} | sections)
    async with service.client() as client, bridge(settings, client) as ports:
        yield ports


class Lines:
    """A controller that speaks text lines."""

    def __init__(self, reader, writer) -> None:
        self._reader, self._writer = reader, writer

    async def ask(self, line: str) -> str:
        self._writer.write(line.encode() + b"\r\n")
        return (await asyncio.wait_for(self._reader.readline(), 10)).decode().removesuffix("\r\n")


async def lines_to(ports) -> Lines:
    return Lines(*await asyncio.open_connection("127.0.0.1", ports["ascii"]))


def ask(file, *lines: str, service=None, **sections) -> list[str]:
    """The replies to lines sent one after the other."""

    async def scenario() -> list[str]:
        async with running(file, service, **sections) as ports:
            controller = await lines_to(ports)
            return [await controller.ask(line) for line in lines]

    return asyncio.run(scenario())


def test_trigger_result_and_poses(picture):
    *accepted, result, middle, beyond = ask(picture, "T,12,7", "R,12", "G,12,2", "G,12,4")
    assert accepted == ["T,12,1"]
    assert result.startswith("R,12,0,3,7,3,")
    assert middle == "G,12,0,2,2,1,0.9,0.25,-0.125,0.05,0,3.1,0.25"
    assert beyond == "G,12,25"


@pytest.mark.parametrize(
    ("lines", "last"),
    [
        (["T,1,8", "R,1"], "R,1,40,0,8,0"),
        (["T,1,11", "R,1"], "R,1,22,0,11,0"),
        (["T,1,10", "R,1"], "R,1,10,0,10,0"),
        (["R,5"], "R,5,23,0,0,0,0"),
        (["G,5,1"], "G,5,23"),
        (["X,5"], "X,5,23"),
        (["Q,5"], "E,0,20"),
        (["T"], "T,0,21"),
        (["T,1"], "T,1,21"),
        (["T,1,70000"], "T,1,21"),
        (["T,-1,7"], "T,0,21"),
        (["T,1,7,0,0,0"], "T,1,21"),
        (["T,1,7,0,0,0,0,0,nan"], "T,1,21"),
        (["H,77"], "H,77,0,0,0,0,0"),
        (["ÿ"], "E,0,20"),
        (["t,1,7"], "T,1,1"),
    ],
)
def test_statuses(picture, lines, last):
    found = ask(picture, *lines)[-1]
    assert found == last or found.startswith(f"{last},"), found


def test_without_a_picture_nothing_starts(tmp_path):
    assert ask(tmp_path / "none.png", "T,1,7", "R,1") == ["T,1,30", "R,1,23,0,0,0,0"]


def test_the_next_job_is_accepted_while_the_last_computes(picture):
    async def scenario():
        service = RecipeService()
        async with running(picture, service) as ports:
            first, second = await lines_to(ports), await lines_to(ports)
            assert await first.ask("T,1,9") == "T,1,1"
            assert await first.ask("R,1,0") == "R,1,2,0,0,0,0"
            assert await first.ask("T,1,7") == "T,1,24", "its number is in use"
            held = asyncio.create_task(first.ask("R,1"))
            assert await second.ask("T,2,7") == "T,2,1"
            assert (await second.ask("R,2")).startswith("R,2,0,3")
            assert await second.ask("H,3") == "H,3,0,1,0,1,0"
            service.go.set()
            assert (await held).startswith("R,1,0,3")
            assert await first.ask("T,1,7") == "T,1,1", "a number whose job has ended is used anew"

    asyncio.run(scenario())


def test_no_more_jobs_than_configured(picture):
    replies = ask(
        picture, "T,1,9", "T,2,9", "T,3,9", "X,1", "R,1", "T,3,9", jobs={"most_waiting": 2}
    )
    assert replies == ["T,1,1", "T,2,1", "T,3,26", "X,1,0", "R,1,41,0,0,0,0", "T,3,1"]


def test_pictures_from_several_places_make_one_job(picture):
    service = RecipeService()
    ask(picture, "P,4,0,0,0.5,0,3.1,0", "T,4,7,0.1,0,0.5,0,3.1,0", "R,4", service=service)
    (body,) = service.bodies
    assert body.count(b"picture 1") == 2
    assert b"[[0.0, 0.0, 0.5, 0.0, 3.1, 0.0], [0.1, 0.0, 0.5, 0.0, 3.1, 0.0]]" in body


def test_replies_in_parentheses(picture):
    section = {"ascii": {"port": 0, "reply": "parentheses"}}
    assert ask(picture, "T,1,7", "R,1", "Q", **section)[0] == "(1,1)"


def test_the_newest_file_of_a_folder(tmp_path):
    for age, name in ((100, "old.png"), (1, "new.png"), (0, "new.txt")):
        (tmp_path / name).write_bytes(name.encode())
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    service = RecipeService()
    folder = {"folder": tmp_path, "pattern": "*.png"}
    ask(tmp_path, "T,1,7", "R,1", service=service, picture=folder)
    assert b"new.png" in service.bodies[0]
    assert ask(tmp_path, "T,1,7", picture=folder | {"most_age_s": 5}) == ["T,1,30"]


def frame(
    command: int,
    sequence: int,
    recipe: int = 0,
    first: int = 0,
    wait=0xFFFFFFFF,
    flange=(),
    order=">",
) -> bytes:
    numbers = [*flange, *([0.0] * (7 - len(flange)))]
    flags = {0: 0, 6: 1, 7: 2}[len(flange)]
    return struct.pack(
        order + "HHIHHIHxx7f16x", 0x444C, command, sequence, recipe, first, wait, flags, *numbers
    )


@pytest.mark.parametrize(("order", "name"), [(">", "big"), ("<", "little")])
def test_fixed_bytes(picture, order, name):
    service = RecipeService()
    service.poses = POSES * 5

    async def scenario():
        async with running(picture, service, binary={"port": 0, "byte_order": name}) as ports:
            reader, writer = await asyncio.open_connection("127.0.0.1", ports["binary"])

            async def reply(request: bytes) -> bytes:
                writer.write(request[:10])
                await writer.drain()
                writer.write(request[10:])
                return await asyncio.wait_for(reader.readexactly(512), 10)

            requests = [
                frame(2, 300, 7, flange=(0.1, 0, 0.5, 0, 3, 0), order=order),
                frame(3, 300, order=order),
                frame(3, 300, first=12, order=order),
                frame(5, 9, order=order),
                frame(9, 1, order=order),
                b"\0" * 64,
                frame(2, 2**31, 7, order=order),
                frame(2, 1, 7, flange=(float("nan"),) * 7, order=order),
                frame(4, 77, order=order),
            ]
            return [await reply(request) for request in requests]

    replies = asyncio.run(scenario())
    heads = [struct.unpack_from(order + "HHIHHHHHHIHH", reply) for reply in replies]
    assert [head[3] for head in heads] == [1, 0, 0, 0, 20, 20, 21, 21, 23]
    assert {head[0] for head in heads} == {0x444C}
    _, command, sequence, _, poses, first, here, recipe, version, *_ = heads[1]
    assert (command, sequence, poses, first, here, recipe, version) == (3, 300, 15, 0, 12, 7, 3)
    assert heads[2][5:7] == (12, 3)
    pose = struct.unpack_from(order + "HHf3f4f", replies[1], 32 + 40)
    assert pose == pytest.approx((1, 2, 0.9, 0.25, -0.125, 0.05, 0, 3.1, 0.25, 0))
    assert b"[[0.1" in service.bodies[0]


def test_a_line_without_an_end_closes_the_connection(picture):
    async def scenario():
        async with running(picture) as ports:
            reader, writer = await asyncio.open_connection("127.0.0.1", ports["ascii"])
            writer.write(b"T" * 5000)
            assert await asyncio.wait_for(reader.read(), 10) == b""
            assert await (await lines_to(ports)).ask("H,1") == "H,1,0,0,0,0,0"

    asyncio.run(scenario())


def test_only_listed_controllers_are_answered(picture):
    async def scenario():
        async with running(picture, ascii={"port": 0, "allow": ["192.0.2.1"]}) as ports:
            reader, _ = await asyncio.open_connection("127.0.0.1", ports["ascii"])
            return await asyncio.wait_for(reader.read(), 10)

    assert asyncio.run(scenario()) == b""


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("", "picture"),
        ('[picture]\nfile = "a"', "ascii"),
        ('[ascii]\nport = 1\n[picture]\nfile = "a"\nurl = "http://a"', "url"),
        ('[ascii]\nport = 1\nhost = "0.0.0.0"\n[picture]\nfile = "a"', "allow"),
        ('[ascii]\nport = 70000\n[picture]\nfile = "a"', "port"),
        ("[ascii", "TOML"),
    ],
)
def test_settings_that_cannot_be_are_named(tmp_path, text, field):
    file = tmp_path / "bridge.toml"
    file.write_text(text)
    with pytest.raises(InvalidArgument, match=field):
        read(file)
