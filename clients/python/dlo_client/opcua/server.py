"""The OPC UA server: endpoint, security, nodes, and the vision system that writes to them."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from asyncua import ua
from asyncua.server.server import Server

from dlo_client.async_client import AsyncClient
from dlo_client.bridge.cell import TakePicture
from dlo_client.bridge.settings import JobsSection, OpcUaSection
from dlo_client.opcua.address_space import build
from dlo_client.opcua.vision_system import VisionSystem


@asynccontextmanager
async def opcua_server(
    section: OpcUaSection, client: AsyncClient, take_picture: TakePicture, jobs: JobsSection
) -> AsyncIterator[VisionSystem]:
    """The server while the context is open."""
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://{section.host}:{section.port}/dlo")
    server.set_server_name("DLO perception")
    if section.certificate is not None and section.key is not None:
        await server.load_certificate(str(section.certificate))
        await server.load_private_key(str(section.key))
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
    else:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    system = VisionSystem(client, take_picture, jobs)
    nodes = await build(server, system.methods())
    async with server:
        task = asyncio.create_task(system.run(nodes))
        try:
            yield system
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task
