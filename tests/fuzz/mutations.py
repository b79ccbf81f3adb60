"""Damage: to the JSON of a request, and to the bytes of a picture. The same random numbers give the
same damage."""

from __future__ import annotations

import copy
import json
import random
from typing import Any

_ODD: list[Any] = [
    None,
    True,
    -1,
    0,
    1e308,
    -1e-320,
    2**63,
    "",
    "x" * 10_000,
    "\ud800",
    [],
    {},
    [[]],
    {"id": "0" * 64},
    {"part": 0},
    [0] * 300,
    float("nan"),
    float("inf"),
    "2026-11-28",
    "../../etc/passwd",
    [None],
]
_MOST = 4


def damaged_request(request: dict[str, Any], chance: random.Random) -> bytes:
    """The JSON of a request with a few places changed, now and then no JSON at all."""
    changed = copy.deepcopy(request)
    for _ in range(chance.randint(1, _MOST)):
        _change(changed, chance)
    text = json.dumps(changed)
    return damaged_bytes(text.encode(), chance) if chance.random() < 0.1 else text.encode()


def _change(node: Any, chance: random.Random) -> None:
    """Replace, remove, double or add something, somewhere below ``node``."""
    keys = list(node) if isinstance(node, dict) else list(range(len(node)))
    if not keys:
        return
    key = chance.choice(keys)
    inner = node[key]
    if isinstance(inner, dict | list) and inner and chance.random() < 0.7:
        _change(inner, chance)
        return
    match chance.randint(0, 4):
        case 0:
            del node[key]
        case 1 if isinstance(node, list):
            node.insert(key, copy.deepcopy(inner))
        case 2 if isinstance(node, dict):
            node[chance.choice(["kind", "image", "views", "timeout_s", "files", "q", "model"])] = (
                inner
            )
        case 3 if isinstance(inner, int | float) and not isinstance(inner, bool):
            node[key] = inner * chance.choice([-1, 0, 1e-9, 1e9, 1e300])
        case _:
            node[key] = copy.deepcopy(chance.choice(_ODD))


def damaged_bytes(data: bytes, chance: random.Random, other: bytes = b"") -> bytes:
    """``data`` with bytes changed, cut, moved or doubled, or with a piece of ``other`` in it."""
    changed = bytearray(data)
    for _ in range(chance.randint(1, _MOST)):
        if not changed:
            break
        at = _place(len(changed), chance)
        length = min(len(changed) - at, chance.choice([1, 2, 4, 16, 200, 5000]))
        match chance.randint(0, 6):
            case 0:
                changed[at] ^= 1 << chance.randint(0, 7)
            case 1:
                changed[at : at + length] = chance.randbytes(length)
            case 2:
                del changed[at : at + length]
            case 3:
                changed[at:at] = changed[at : at + length]
            case 4:
                changed[at : at + length] = bytes([chance.choice([0, 255])]) * length
            case 5:
                del changed[at:]
            case _ if other:
                start = chance.randrange(len(other))
                changed[at:at] = other[start : start + length]
    return bytes(changed)


def _place(length: int, chance: random.Random) -> int:
    """Half of all damage is in the first hundred bytes: headers."""
    return chance.randrange(min(length, 100)) if chance.random() < 0.5 else chance.randrange(length)
