"""``python -m tests.rehearsal.relay --listen HOST:PORT --to HOST:PORT,… [--certificate FILE]``: a
plain proxy.

Each connection goes to the next address that can be reached; with a certificate (PEM, key and
chain) it is TLS on this side.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import ssl

from workers.lifeline import die_with_parent

_REACHED_WITHIN_S = 1.0
_CHUNK = 65_536


class Relay:
    def __init__(self, addresses: list[tuple[str, int]]) -> None:
        self._addresses = addresses
        self._next = 0

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection, until either side closes it."""
        with contextlib.suppress(OSError, asyncio.IncompleteReadError):
            inner_reader, inner_writer = await self._connect()
            both = [
                asyncio.create_task(_pump(reader, inner_writer)),
                asyncio.create_task(_pump(inner_reader, writer)),
            ]
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
            for task in both:
                task.cancel()
            inner_writer.close()
        writer.close()

    async def _connect(self) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """To the next of them; raises OSError when none can be reached."""
        for _ in self._addresses:
            host, port = self._addresses[self._next]
            self._next = (self._next + 1) % len(self._addresses)
            with contextlib.suppress(OSError):  # a time-out is one
                return await asyncio.wait_for(
                    asyncio.open_connection(host, port), _REACHED_WITHIN_S
                )
        raise ConnectionRefusedError("no address can be reached")


async def _pump(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await reader.read(_CHUNK):
            writer.write(data)
            await writer.drain()


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    return host, int(port)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--listen", type=_address, required=True)
    parser.add_argument(
        "--to", type=lambda text: [_address(one) for one in text.split(",")], required=True
    )
    parser.add_argument("--certificate")
    parser.add_argument("--with-parent", type=int)
    asked = parser.parse_args()
    if asked.with_parent:
        die_with_parent(signal.SIGKILL, asked.with_parent)
    context = None
    if asked.certificate:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(asked.certificate)

    async def run() -> None:
        host, port = asked.listen
        server = await asyncio.start_server(Relay(asked.to).serve, host, port, ssl=context)
        await server.serve_forever()

    asyncio.run(run())


if __name__ == "__main__":
    main()
