"""The sockets of the bridge: one task a connection, requests answered in their order."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager

from dlo_client.async_client import AsyncClient
from dlo_client.bridge.cell import Cell, TakePicture
from dlo_client.bridge.fixed_bytes import REQUEST_BYTES, FixedBytes
from dlo_client.bridge.settings import BridgeSettings, JobsSection, ListenSection, OpcUaSection
from dlo_client.bridge.sources import picture_source
from dlo_client.bridge.text_lines import LONGEST_LINE, TextLines
from dlo_client.errors import InvalidArgument

log = logging.getLogger(__name__)
Answer = Callable[[asyncio.StreamReader], Awaitable[bytes | None]]
"""The reply to the next request of a connection; None when there is none any more."""


@asynccontextmanager
async def bridge(settings: BridgeSettings, client: AsyncClient) -> AsyncIterator[dict[str, int]]:
    """Runs while the context is open; gives the port of each protocol."""
    take = picture_source(settings.picture)
    cell = Cell(client, take, settings.jobs)
    stack = AsyncExitStack()
    servers: list[asyncio.Server] = []
    ports: dict[str, int] = {}
    try:
        if settings.ascii is not None:
            lines = TextLines(cell, settings.ascii.reply == "parentheses")
            servers.append(await _listen(settings.ascii, _line_answer(lines)))
            ports["ascii"] = servers[-1].sockets[0].getsockname()[1]
        if settings.binary is not None:
            fixed = FixedBytes(cell, settings.binary.byte_order)
            servers.append(await _listen(settings.binary, _bytes_answer(fixed)))
            ports["binary"] = servers[-1].sockets[0].getsockname()[1]
        if settings.opcua is not None:
            await stack.enter_async_context(_opcua(settings.opcua, client, take, settings.jobs))
            ports["opcua"] = settings.opcua.port
        yield ports
    finally:
        await stack.aclose()
        for server in servers:
            server.close()
        await cell.close()


def _opcua(
    section: OpcUaSection, client: AsyncClient, take: TakePicture, jobs: JobsSection
) -> AbstractAsyncContextManager[object]:
    """The OPC UA server, which is an extra."""
    try:
        from dlo_client.opcua.server import opcua_server
    except ModuleNotFoundError as error:
        text = f'needs its extra: pip install "dlo-client[opcua]" (not found: {error.name})'
        raise InvalidArgument("opcua", text) from None
    return opcua_server(section, client, take, jobs)


def _line_answer(lines: TextLines) -> Answer:
    async def answer(reader: asyncio.StreamReader) -> bytes | None:
        try:
            line = await reader.readuntil(b"\n")
        except asyncio.IncompleteReadError:
            return None
        except asyncio.LimitOverrunError:
            log.warning("a line is longer than %d bytes: connection closed", LONGEST_LINE)
            return None
        text = line.decode("ascii", "replace").strip()
        return await lines.reply(text) if text else b""

    return answer


def _bytes_answer(fixed: FixedBytes) -> Answer:
    async def answer(reader: asyncio.StreamReader) -> bytes | None:
        try:
            return await fixed.reply(await reader.readexactly(REQUEST_BYTES))
        except asyncio.IncompleteReadError:
            return None

    return answer


async def _listen(section: ListenSection, answer: Answer) -> asyncio.Server:
    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            if _welcome(section, writer):
                await _converse(reader, writer, answer)
        except (ConnectionError, asyncio.CancelledError):
            pass
        finally:
            writer.close()
            with contextlib.suppress(ConnectionError, asyncio.CancelledError):
                await writer.wait_closed()

    return await asyncio.start_server(serve, section.host, section.port, limit=LONGEST_LINE)


async def _converse(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, answer: Answer
) -> None:
    while (reply := await answer(reader)) is not None:
        writer.write(reply)
        await writer.drain()


def _welcome(section: ListenSection, writer: asyncio.StreamWriter) -> bool:
    """Whether the peer is one that is allowed."""
    peer = ipaddress.ip_address(writer.get_extra_info("peername")[0])
    welcome = peer in section.allow if section.allow else peer.is_loopback
    if not welcome:
        log.warning("%s is not among the controllers that `allow` lists", peer)
    return welcome
