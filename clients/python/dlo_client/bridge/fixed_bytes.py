"""The protocol of fixed bytes: a request of 64, a reply of 512; numbers in one byte order, floats
of IEEE 754.

Request:

======  ====  ===========  =========================================================================================
offset  size  type         meaning
======  ====  ===========  =========================================================================================
0       2     u16          0x444C
2       2     u16          command: 1 picture, 2 trigger, 3 result, 4 cancel, 5 heartbeat
4       4     u32          sequence number, the controller's own, up to 2147483647
8       2     u16          recipe (trigger)
10      2     u16          first pose wanted, from 0 (result)
12      4     u32          milliseconds to wait (result); 0xFFFFFFFF: as configured
16      2     u16          bit 0: a pose of the flange is given, with 3 numbers of rotation; bit 1: with 4
18      2                  0
20      28    7 × f32      x, y, z, r1, r2, r3, r4 of the flange
48      16                 0
======  ====  ===========  =========================================================================================

Reply:

======  ====  ===========  =========================================================================================
offset  size  type         meaning
======  ====  ===========  =========================================================================================
0       2     u16          0x444C
2       2     u16          command, as in the request
4       4     u32          sequence number, as in the request
8       2     u16          status
10      2     u16          poses of the result
12      2     u16          first pose in this reply
14      2     u16          poses in this reply, up to 12
16      2     u16          recipe
18      2     u16          its version, modulo 65536
20      4     u32          milliseconds that the job took
24      2     u16          jobs under way
26      2     u16          results that were not asked for
28      4                  0
32      480   12 × 40      poses: u16 id, u16 role, f32 score, 3 × f32 position, 4 × f32 rotation, 4 bytes 0
======  ====  ===========  =========================================================================================

Roles are those of the text lines. A request that does not begin with 0x444C is answered with status
20.
"""

from __future__ import annotations

import math
import struct
from typing import Literal

from dlo_client.bridge.cell import LARGEST_SEQUENCE, Cell, Outcome
from dlo_client.bridge.status import Status
from dlo_client.bridge.text_lines import ROLES
from dlo_client.contracts.frames import RobotPose

MAGIC = 0x444C
REQUEST_BYTES, REPLY_BYTES, POSES = 64, 512, 12
PICTURE, TRIGGER, RESULT, CANCEL, HEARTBEAT = range(1, 6)
_AS_CONFIGURED = 0xFFFF_FFFF
_REQUEST = "HHIHHIHxx7f16x"
_HEAD = "HHIHHHHHHIHH4x"
_POSE = "HHf3f4f4x"


class FixedBytes:
    """Replies to requests."""

    def __init__(self, cell: Cell, byte_order: Literal["big", "little"]) -> None:
        sign = ">" if byte_order == "big" else "<"
        self._cell = cell
        self._request = struct.Struct(sign + _REQUEST)
        self._head = struct.Struct(sign + _HEAD)
        self._pose = struct.Struct(sign + _POSE)

    async def reply(self, request: bytes) -> bytes:
        """512 bytes for 64."""
        magic, command, sequence, recipe, first, wait_ms, flags, *numbers = self._request.unpack(
            request
        )
        flange = _flange(flags, numbers)
        if magic != MAGIC:
            return self._written(command, sequence, Outcome(Status.UNKNOWN_COMMAND))
        if flange is None or sequence > LARGEST_SEQUENCE:
            return self._written(command, sequence, Outcome(Status.BAD_ARGUMENT))
        match command:
            case 1:
                outcome = Outcome(await self._cell.picture(sequence, flange))
            case 2:
                outcome = Outcome(await self._cell.trigger(sequence, recipe, flange), recipe=recipe)
            case 3:
                wait_s = None if wait_ms == _AS_CONFIGURED else min(wait_ms, 60_000) / 1000
                outcome = await self._cell.result(sequence, wait_s)
            case 4:
                outcome = Outcome(self._cell.cancel(sequence))
            case 5:
                outcome = Outcome(Status.OK)
            case _:
                outcome = Outcome(Status.UNKNOWN_COMMAND)
        return self._written(command, sequence, outcome, first)

    def _written(self, command: int, sequence: int, outcome: Outcome, first: int = 0) -> bytes:
        state = self._cell.state()
        here = outcome.poses[first : first + POSES]
        head = self._head.pack(
            MAGIC,
            command,
            sequence,
            outcome.status,
            min(len(outcome.poses), 0xFFFF),
            first,
            len(here),
            outcome.recipe,
            outcome.version % 65_536,
            min(outcome.time_ms, 0xFFFF_FFFF),
            state.busy,
            state.waiting,
        )
        body = b"".join(self._packed(pose) for pose in here)
        return (head + body).ljust(REPLY_BYTES, b"\0")

    def _packed(self, pose: RobotPose) -> bytes:
        turn = [*pose.rotation, 0.0][:4]
        return self._pose.pack(
            pose.id % 65_536, ROLES[pose.role], pose.score, *pose.position, *turn
        )


def _flange(flags: int, numbers: list[float]) -> list[float] | None:
    """Empty when no pose is given; None for one that is none."""
    if not flags & 3:
        return []
    given = numbers[: 7 if flags & 2 else 6]
    return given if all(math.isfinite(number) for number in given) else None
