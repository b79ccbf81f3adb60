"""The picture of a Label Studio task: from its server, or from the folder that is its local
storage.

Nothing else is fetched: a task's data may name any address, and whoever can make tasks could make
this program call it.
"""

from __future__ import annotations

from pathlib import Path
from urllib.parse import parse_qs, unquote, urlsplit

import httpx

from dlo_client.labelling.formats.exchange import Refused

_LARGEST_BYTES = 64 * 1024 * 1024
_TIMEOUT_S = 20.0
_LOCAL = "/data/local-files/"


class TaskPictures:
    """``host`` and ``token`` of Label Studio; ``root`` is the folder of its local storage, if there
    is one."""

    def __init__(
        self,
        host: str = "",
        token: str = "",
        root: Path | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        self.host, self.token = host.rstrip("/"), token
        self._root = root
        self._transport = transport

    def read(self, address: str) -> bytes:
        """Raises Refused, with the reason, where there is no picture."""
        parts = urlsplit(address)
        if parts.path == _LOCAL and not parts.netloc and self._root is not None:
            return self._local(unquote(parse_qs(parts.query).get("d", [""])[0]))
        if not self.host:
            raise Refused("Label Studio's address is not known: give --host")
        own = urlsplit(self.host)
        if parts.netloc and (parts.scheme, parts.netloc) != (own.scheme, own.netloc):
            raise Refused(
                f"{parts.netloc} is not Label Studio: upload the picture there, or use its local storage"
            )
        if not parts.netloc and not parts.path.startswith("/"):
            raise Refused(f"{address[:100]!r} is no address of a picture")
        query = f"?{parts.query}" if parts.query else ""
        return self._fetched(f"{self.host}{parts.path.removeprefix(own.path.rstrip('/'))}{query}")

    def _local(self, name: str) -> bytes:
        assert self._root is not None
        path = (self._root / name).resolve()
        if not path.is_relative_to(self._root.resolve()) or not path.is_file():
            raise Refused(f"{name[:100]!r} is not in {self._root}")
        return path.read_bytes()

    def _fetched(self, address: str) -> bytes:
        try:
            with httpx.Client(timeout=_TIMEOUT_S, transport=self._transport) as http:
                reply = http.get(address, headers=self._headers(http))
        except httpx.HTTPError as error:
            raise Refused(
                f"Label Studio does not answer: {error or type(error).__name__}"
            ) from error
        if not reply.is_success:
            raise Refused(f"Label Studio answers {reply.status_code} for {urlsplit(address).path}")
        if len(reply.content) > _LARGEST_BYTES:
            raise Refused("the picture is too large")
        return reply.content

    def _headers(self, http: httpx.Client) -> dict[str, str]:
        """A legacy token as it is; a personal access token is exchanged for one that opens."""
        if not self.token:
            return {}
        if self.token.count(".") != 2:
            return {"Authorization": f"Token {self.token}"}
        reply = http.post(f"{self.host}/api/token/refresh", json={"refresh": self.token})
        access = reply.json().get("access", "") if reply.is_success else ""
        return {"Authorization": f"Bearer {access}"}
