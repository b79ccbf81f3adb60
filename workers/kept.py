"""Documents that stay: recipes and cameras, by name, every change a new version.

Strategy: one hash a name holds its versions as JSON texts, and the number of the latest; one script
adds a version, so that two replicas never give the same number. All of them live in the queue
server, where every replica sees them. The pictures that a document names are listed beside it, and
the sweep of the blobs leaves them alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import redis

from workers.blobs import Blobs
from workers.keys import Keys

_MOST_VERSIONS = 100
"""Of one name; the oldest go."""
_MOST_NAMES = 2000

_PUT = """
local key, names, name, text, pictures = KEYS[1], KEYS[2], ARGV[1], ARGV[2], ARGV[3]
if redis.call('HEXISTS', names, name) == 0 and redis.call('HLEN', names) >= tonumber(ARGV[5]) then return 0 end
local version = redis.call('HINCRBY', key, 'latest', 1)
redis.call('HSET', key, version, text, version .. ':pictures', pictures)
local old = version - tonumber(ARGV[4])
redis.call('HDEL', key, old, old .. ':pictures')
redis.call('HSET', names, name, version)
return version
"""

_DELETE = """
local latest = redis.call('HGET', KEYS[1], 'latest')
redis.call('HDEL', KEYS[2], ARGV[1])
redis.call('DEL', KEYS[1])
return latest
"""

SHELVES = ("recipes", "cameras")


class FullError(Exception):
    """There are as many documents as may be."""


@dataclass(frozen=True)
class Kept:
    """One version of a document, as JSON text."""

    name: str
    version: int
    text: str


class Shelf:
    """The documents of one sort; every method raises ``redis.RedisError`` when the queue server
    does not answer."""

    def __init__(self, client: redis.Redis, keys: Keys, sort: str) -> None:
        self._client = client
        self._names = keys
        self._sort = sort
        self._put = client.register_script(_PUT)
        self._delete = client.register_script(_DELETE)

    def put(self, name: str, text: str, pictures: Sequence[str] = ()) -> int:
        """Add a version, which names ``pictures`` (blob ids); its number. Raises FullError."""
        limits = [_MOST_VERSIONS, _MOST_NAMES]
        version = int(
            self._put(keys=self._keys(name), args=[name, text, " ".join(pictures), *limits])
        )
        if not version:
            raise FullError(f"there are {_MOST_NAMES} {self._sort}, as many as may be")
        return version

    def get(self, name: str, version: int | None = None) -> Kept | None:
        """The latest version, or another that is still kept."""
        key = self._keys(name)[0]
        wanted = version or int(cast(str | None, self._client.hget(key, "latest")) or 0)
        text = cast(str | None, self._client.hget(key, str(wanted))) if wanted > 0 else None
        return None if text is None else Kept(name, wanted, text)

    def latest(self) -> list[Kept]:
        """The latest version of every name, by name."""
        names = sorted(cast(dict[str, str], self._client.hgetall(self._keys("")[1])))
        return [kept for name in names if (kept := self.get(name))]

    def history(self, name: str) -> list[Kept]:
        """The versions that are kept, newest first."""
        fields = cast(dict[str, str], self._client.hgetall(self._keys(name)[0]))
        numbers = sorted((int(field) for field in fields if field.isdecimal()), reverse=True)
        return [Kept(name, number, fields[str(number)]) for number in numbers]

    def delete(self, name: str) -> bool:
        """Forget all versions; False if there were none. A name that is used again counts from
        1."""
        return self._delete(keys=self._keys(name), args=[name]) is not None

    def pictures(self) -> set[str]:
        """Blob ids that any version names."""
        found: set[str] = set()
        for name in cast(list[str], self._client.hkeys(self._keys("")[1])):
            fields = cast(dict[str, str], self._client.hgetall(self._keys(name)[0]))
            found |= {
                one
                for field, ids in fields.items()
                if field.endswith(":pictures")
                for one in ids.split()
            }
        return found

    def _keys(self, name: str) -> list[str]:
        return [self._names.shelved(self._sort, name), self._names.shelf(self._sort)]


def kept_pictures(client: redis.Redis, keys: Keys) -> set[str]:
    """Blob ids that documents of any sort name."""
    return set().union(*(Shelf(client, keys, sort).pictures() for sort in SHELVES))


def sweep(blobs: Blobs, client: redis.Redis, keys: Keys) -> int:
    """Remove old blobs, but for the pictures of documents; nothing while the queue server cannot
    name them."""
    for blob_id in kept_pictures(client, keys):
        blobs.touch(blob_id)
    return blobs.sweep()
