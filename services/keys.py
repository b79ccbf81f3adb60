"""API keys: whose they are, what they allow, and where they are written down.

The file of ``DLO_API_KEYS_FILE`` holds the SHA-256 of each key and is read again when it changes::

    [[keys]]
    name = "cell-3"                  # the owner of its jobs; two keys of one name are one owner's, for a rotation
    sha256 = "…"
    scopes = ["read", "submit"]      # the default; admin sees and cancels everybody's jobs
    expires = 2027-01-01T00:00:00Z   # the rest limits the key, and may be left out
    requests_per_minute = 600
    requests_at_once = 50
    jobs = 100
    stored_bytes = 10_000_000_000
    model = "cell7"                  # foreground network of its requests that name none
    keep_if_unsure = true            # keep the pictures that the service was least sure of, for `dlo review`

``python -m services.keys FILE NAME`` makes a key, appends it and prints it once.
"""

from __future__ import annotations

import argparse
import hashlib
import hmac
import secrets
import time
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

import structlog
from pydantic import (
    AwareDatetime,
    BaseModel,
    ConfigDict,
    Field,
    PositiveInt,
    TypeAdapter,
    ValidationError,
)

Scope = Literal["read", "submit", "admin"]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
SCOPES: tuple[Scope, ...] = ("read", "submit", "admin")
_LOOK_EVERY_S = 1.0

log = structlog.get_logger(__name__)


class Key(BaseModel):
    """One key and its limits; None is no limit."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$")
    sha256: Digest
    scopes: tuple[Scope, ...] = ("read", "submit")
    expires: AwareDatetime | None = None
    requests_per_minute: PositiveInt | None = None
    requests_at_once: PositiveInt | None = None
    jobs: PositiveInt | None = None
    stored_bytes: PositiveInt | None = None
    keep_if_unsure: bool = False
    model: str | None = Field(default=None, pattern=r"^[a-z0-9][a-z0-9_.-]{0,63}(@[1-9]\d{0,5})?$")

    def allows(self, scope: Scope) -> bool:
        return scope in self.scopes or "admin" in self.scopes

    @property
    def expired(self) -> bool:
        return self.expires is not None and self.expires <= datetime.now(UTC)


_KEYS = TypeAdapter(dict[Literal["keys"], tuple[Key, ...]])


class KeyRing:
    """The keys that open: those of the file, and those whose hashes are settings, which may do
    everything."""

    def __init__(self, hashes: tuple[str, ...], file: Path | None) -> None:
        """Raises ValueError or OSError if the file cannot be used."""
        self._fixed = tuple(
            Key(name=f"key-{digest[:8]}", sha256=digest, scopes=SCOPES) for digest in hashes
        )
        self._file = file
        self._looked = time.monotonic()
        self._version = _version(file) if file else None
        self._read = read(file) if file else ()

    def find(self, presented: str) -> Key | None:
        """The key that was presented, if it is one and has not expired."""
        self._look()
        digest = hashlib.sha256(presented.encode()).hexdigest()
        keys = (*self._fixed, *self._read)
        matches = [
            key for key in keys if hmac.compare_digest(digest, key.sha256)
        ]  # all: time tells nothing
        return next((key for key in matches if not key.expired), None)

    def _look(self) -> None:
        """Read the file again if it has changed; one that cannot be used changes nothing."""
        now = time.monotonic()
        if self._file is None or now - self._looked < _LOOK_EVERY_S:
            return
        self._looked = now
        try:
            if (version := _version(self._file)) != self._version:
                self._version = version
                self._read = read(self._file)
                log.info("API keys read again", keys=len(self._read))
        except (OSError, ValueError) as error:
            log.error("API keys cannot be read again; the old ones stay", error=str(error))


def read(file: Path) -> tuple[Key, ...]:
    """The keys of a file; raises OSError, or ValueError that states what is wrong with it."""
    try:
        keys = _KEYS.validate_python(tomllib.loads(file.read_text(encoding="utf-8"))).get(
            "keys", ()
        )
    except ValidationError as error:
        where = "; ".join(
            f"{'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()[:3]
        )
        raise ValueError(f"{file}: {where}") from None
    except ValueError as error:
        raise ValueError(f"{file}: {error}") from None
    if not keys:
        raise ValueError(f"{file}: holds no key")
    return keys


def add(file: Path, name: str, scopes: tuple[Scope, ...]) -> str:
    """Make a key, append it to the file and return it: it cannot be had again."""
    key = secrets.token_urlsafe(32)
    made = Key(name=name, sha256=hashlib.sha256(key.encode()).hexdigest(), scopes=scopes)
    quoted = ", ".join(f'"{scope}"' for scope in made.scopes)
    file.touch(0o600)
    with file.open("a", encoding="utf-8") as out:
        out.write(
            f'\n[[keys]]\nname = "{made.name}"\nsha256 = "{made.sha256}"\nscopes = [{quoted}]\n'
        )
    return key


def _version(file: Path) -> tuple[int, int, int]:
    status = file.stat()
    return status.st_mtime_ns, status.st_size, status.st_ino


def main() -> None:
    """Make a key."""
    parser = argparse.ArgumentParser(
        prog="python -m services.keys", description="Make an API key and print it."
    )
    parser.add_argument("file", type=Path)
    parser.add_argument("name", help="the owner of its jobs")
    parser.add_argument(
        "--scope", dest="scopes", action="append", choices=SCOPES, help="default: read and submit"
    )
    arguments = parser.parse_args()
    print(add(arguments.file, arguments.name, tuple(arguments.scopes or ("read", "submit"))))


if __name__ == "__main__":
    main()
